"""What is told of the numbers: parameters, verdict, published values, the report's evidence and methods."""
