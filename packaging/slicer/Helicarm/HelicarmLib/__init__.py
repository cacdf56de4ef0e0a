# SPDX-License-Identifier: Apache-2.0
"""What the module needs beside Slicer: `scene` has numbers and shapes, `work` measures a case in the background."""
