"""What a measured drive and a measured loop say of the margins of gain and delay that are left."""
