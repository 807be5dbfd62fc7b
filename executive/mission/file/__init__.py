"""Mission files: their schema, their parameters, and what becomes of them."""
