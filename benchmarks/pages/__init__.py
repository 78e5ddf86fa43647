"""The pages as a browser shows them: `python -m benchmarks.pages` takes pictures of all reports and checks each."""
