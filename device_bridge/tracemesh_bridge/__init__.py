"""The device bridge: turns what devices speak into tracemesh's wire messages and loses none of them."""
