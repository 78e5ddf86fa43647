"""What the findings of `rap.therapy` hold and what its report shows."""
