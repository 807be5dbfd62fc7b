"""Files that a user wrote or brought: one guarded way to open them, one reader of YAML, one error."""
