"""Speech: from sound to the words that were said."""
