"""The commands of tracemesh-bridge: options in, what they run out."""
