"""Names of the files in an archive."""

from runtime import bundle as form

MANIFEST, SIGNATURE = "release.json", "release.sig"
BUNDLE, DBC, MAP, SIGNALS = "bundle/", "specs/slewright.dbc", "specs/modbus_map.csv", "specs/signals.toml"
SBOM, CONFIGURATION = "sbom.cdx.json", "configuration/machine.toml"
NEEDED = (BUNDLE + form.MANIFEST, BUNDLE + "parameters.json", DBC, MAP, SIGNALS, SBOM)
SHOWN = 12  # digits of a digest that are shown: enough to tell bundles apart
