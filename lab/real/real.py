"""Put the numbers of all campaigns together: one table, and the page that shows it."""

import pandas as pd

from real_cells import page, record

campaigns = [record.read(path) for path in snakemake.input.numbers]
measured = pd.concat(campaigns, ignore_index=True)
measured = record.with_published(measured, record.read(snakemake.input.published))
record.write(measured, snakemake.output.numbers)
text = page.text(measured, record.read(snakemake.input.before), recorded=False)
page.write(text, snakemake.output.page)
