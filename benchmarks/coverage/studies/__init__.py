"""One coverage study an experiment; each module exports `STUDY`."""
