"""Taking an arm pose that is given as joint angles."""
