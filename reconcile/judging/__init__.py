"""What is believed of what was found, and what is asked first."""
