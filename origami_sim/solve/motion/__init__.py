"""Motion along time: explicit, implicit and quasi-static, and runs refined until they are accurate."""
