"""What browsers watch: drawn from accepted messages, apart from what is recorded; may drop, never delay."""
