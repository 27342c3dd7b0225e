"""The formats of the field, one module or package each; `opening` distinguishes them by their content."""
