"""Copies of a store, as a killed process leaves it."""

import sqlite3
from contextlib import closing


def copy_database(path, copy):
    """Copies a database that another connection may have open."""
    with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(copy)) as target:
        source.backup(target)
