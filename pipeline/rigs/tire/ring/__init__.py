"""The flexible ring: what bends the belt, and what the sensors on the inner liner make of it. Plain functions, SI."""
