"""Object storage as artefacts' place: what Snakemake's plugin for S3 does otherwise than a disk."""


def keep_wildcard_constraints(provider):
    """Let rules with the same output patterns be told apart by the constraints of their wildcards.

    Snakemake writes the constraints into the address of an output and matches files against the
    path of its local copy. The S3 plugin (0.3.6) makes that path once, before there are
    constraints; here it follows from the address as it is.

    Parameters
    ----------
    provider : Snakemake's default storage provider, None where artefacts lie on a disk
    """
    if provider is None or not provider.__module__.startswith("snakemake_storage_plugin_s3"):
        return
    # Patched in the class: Snakemake makes an object for each output of each rule.
    objects = provider.get_storage_object_cls()
    objects.local_suffix = lambda self: self.query.removeprefix("s3://")
