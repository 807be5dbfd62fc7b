"""Manual control of a simulated robot: keys, gamepad, live page, saved poses."""
