"""`python -m executive.cli` is `errand`."""

from executive.cli.entry import main

main()
