"""Application behind the commands: prepares requests, runs them, and writes reports; prints nothing.

It combines executive, skills and plant; only the command line imports it.
"""
