"""The formats of the field, one module or package each; `opening` tells them apart by their content."""
