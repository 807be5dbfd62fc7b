"""Runs `errand` as `python -m executive.cli`."""

from executive.cli.entry import main

main()
