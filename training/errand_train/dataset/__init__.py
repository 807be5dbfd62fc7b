"""Pictures of objects in random rooms, with boxes and masks, to learn and to judge a detector by."""
