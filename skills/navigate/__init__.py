"""Navigation of the base: plans paths, follows them and checks them."""
