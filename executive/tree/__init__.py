"""From missions to behaviour trees: the compiler, the behaviours, and what can be said of a tree before it runs."""
