"""A virtual laboratory: physics-based cells, test protocols, a measurement chain, instrument files.

It makes campaigns whose truth is known, for the pipeline to be tested on. The cells are porous-
electrode models solved by PyBaMM; nothing in here is shared with the models of `cellwright`.
"""
