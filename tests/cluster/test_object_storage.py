"""A campaign whose artefacts lie in object storage: an S3-compatible server on this machine."""

import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest
from two_cells import TARGETS, command, needs, write_campaign

BUCKET = "campaign"
LOGIN = {"access_key": "test", "secret_key": "test"}


@pytest.fixture
def server():
    """Address of a server of object storage with one empty bucket."""
    needs("snakemake-storage-plugin-s3", "moto", "flask")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    program = [sys.executable, "-m", "moto.server", "--host", "127.0.0.1", "--port", str(port)]
    process = subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    address = f"http://127.0.0.1:{port}"
    try:
        wait_for(address)
        client(address).create_bucket(Bucket=BUCKET)
        yield address
    finally:
        process.kill()
        process.wait()


def wait_for(address):
    end = time.monotonic() + 120
    while True:
        try:
            return urllib.request.urlopen(address, timeout=5).close()
        except (urllib.error.URLError, TimeoutError, ConnectionError):
            assert time.monotonic() < end, f"{address} does not answer"
            time.sleep(0.2)


def client(address):
    import boto3

    keys = {f"aws_{name}": "test" for name in ("access_key_id", "secret_access_key")}
    return boto3.client("s3", endpoint_url=address, region_name="us-east-1", **keys)


def stored(address):
    """Bytes of each object below results/ of the bucket, by the rest of its key."""
    s3 = client(address)
    keys = [entry["Key"] for entry in s3.list_objects_v2(Bucket=BUCKET).get("Contents", [])]
    return {
        key.partition("results/")[2]: s3.get_object(Bucket=BUCKET, Key=key)["Body"].read()
        for key in keys
        if "results/" in key
    }


@pytest.mark.slow
def test_a_campaign_in_object_storage_ends_with_the_bytes_of_a_plain_run(
    server, tmp_path, local_artefacts
):
    folder = write_campaign(tmp_path / "campaign")
    call = command(
        folder, "--workflow-profile", "workflow/profiles/object_storage", "--cores", "1", *TARGETS,
        "--default-storage-prefix", f"s3://{BUCKET}/two_cells",
    )  # fmt: skip
    call["env"] |= {f"SNAKEMAKE_STORAGE_S3_{name.upper()}": key for name, key in LOGIN.items()}
    call["env"]["SNAKEMAKE_STORAGE_S3_ENDPOINT_URL"] = server
    done = subprocess.run(**call, check=False)
    assert done.returncode == 0, done.stdout
    assert not (folder / "results").exists(), "artefacts lie in the bucket alone"
    # Beside a table lies its provenance, which is no output of the rule and stays on the disk.
    outputs = {
        path: content
        for path, content in local_artefacts.items()
        if not path.endswith(".provenance.json")
    }
    assert stored(server) == outputs
    again = subprocess.run(**call, check=False)
    assert "Nothing to be done" in again.stdout, again.stdout
