"""Pictures of things in random rooms, with boxes and masks, to learn and to judge a detector by."""
