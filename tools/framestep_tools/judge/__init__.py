"""What the pins did, beside what they should have done."""
