"""What the model is held against that does not come from the model; see docs/verification.md."""
