"""What a device's numbers mean: vectors to frames, ticks and times to distances."""
