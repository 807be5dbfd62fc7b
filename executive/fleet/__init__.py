"""Work given out to several robots: an auction, and who has which mission."""
