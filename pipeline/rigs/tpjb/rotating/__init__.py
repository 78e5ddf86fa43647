"""The rotating-load test: orbits under a turning force of constant size, quadratic law, linear limit."""
