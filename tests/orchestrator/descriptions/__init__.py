"""Random valid model descriptions, with what a correct reader must see in each."""
