"""The plant's own memory: its whole state in a file, so that a simulated world outlives the process that ran it.

Nothing outside the plant reads that file.
"""
