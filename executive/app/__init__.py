"""The application: requests become prepared missions, robots and runs; reports and evaluation. It prints nothing.

It puts executive, skills and plant together; only the command line stands above it.
"""
