"""Figure 5 of Lian et al. (2019): a picture, and isetcl's numbers beside the paper's."""

import sys

from isetcl.figures import Quality, draw_figure

result = draw_figure(5, "isetcl-figures", Quality(is_draft="--draft" in sys.argv))
for row in result.rows:
    print(f"{row.quantity}: {row.isetcl} (paper: {row.paper}); {row.verdict}", row.reason)
print(f"see {result.files[0]}")
