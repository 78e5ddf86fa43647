"""From counts and torques to stages and events, without labels (5.1); what is wrong with the counter."""
