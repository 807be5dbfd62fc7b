"""`python -m executive.cli` is `errand`."""

from executive.cli.main import main

main()
