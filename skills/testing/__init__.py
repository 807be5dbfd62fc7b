"""What skills are tried out with: a clock moved by hand, a scripted robot among blocks, and faults by name."""
