"""The cube layout: a closed genus-0 mesh on six charts, by way of its sphere map."""
