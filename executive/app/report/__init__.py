"""Results of a run: its report as data and as a page, with pictures."""
