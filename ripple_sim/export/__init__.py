"""Results that leave the house: moving geometry, fields and tables in the formats of other programs."""
