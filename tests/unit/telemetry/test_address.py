"""The address of a broker: what it takes, and what it refuses without showing a password."""

import subprocess

import pytest

from smadrive.errors import ConfigError
from smadrive.telemetry.address import PASSWORD_VARIABLE, parse_address


def test_defaults():
    address = parse_address("mqtt://broker", {})
    assert (address.host, address.port, address.tls, address.prefix) == ("broker", 1883, False, "smadrive")
    assert (address.user, address.password) == (None, None)


def test_every_part(tmp_path):
    secret = tmp_path / "a+b"
    secret.write_text("s3cret\n")
    address = parse_address(f"mqtts://lab%20user@[::1]:9000/lab/wires?password_file={secret}", {})
    assert (address.host, address.port, address.tls, address.prefix) == ("::1", 9000, True, "lab/wires")
    assert (address.user, address.password) == ("lab user", "s3cret")
    assert "s3cret" not in repr(address)


def test_password_comes_from_the_environment():
    assert parse_address("mqtt://me@broker", {PASSWORD_VARIABLE: "x"}).password == "x"  # noqa: S105
    assert parse_address("mqtt://broker", {PASSWORD_VARIABLE: "x"}).password is None


@pytest.mark.parametrize(
    ("url", "where"),
    [
        ("mqtt://me:hunter2@broker", "--publish"),
        ("http://me:hunter2@broker", "--publish"),
        ("mqtt://me:hunter2@broker:99999", "--publish"),
        ("mqtt://me:hunter2@", "--publish"),
        ("http://broker", "--publish"),
        ("broker", "--publish"),
        ("mqtt://", "--publish"),
        ("mqtt://broker..lab", "--publish"),
        (f"mqtt://{64 * 'a'}.lab", "--publish"),
        ("mqtt://broker:0", "--publish"),
        ("mqtt://broker/\udcff", "--publish"),
        ("mqtt://\udcff@broker", "--publish"),
        ("mqtt://broker:abc", "--publish"),
        ("mqtt://broker/a/%23", "--publish: prefix"),
        ("mqtt://broker/a/+", "--publish: prefix"),
        ("mqtt://broker/a/#", "--publish"),
        ("mqtt://broker?password=x", "--publish"),
        ("mqtt://broker?password_file=missing", "--publish: password_file"),
        (f"mqtt://broker?password_file={__file__}", "--publish: password_file"),
        ("mqtts://broker?ca_file=missing", "--publish: ca_file"),
        (f"mqtts://broker?ca_file={__file__}&ca_file={__file__}", "--publish"),
        (f"mqtt://broker?ca_file={__file__}", "--publish: ca_file"),
        (f"mqtts://broker?cert_file={__file__}", "--publish: cert_file and key_file"),
        (f"mqtts://broker?ca_file={__file__}", "--publish: ca_file and cert_file and key_file"),
    ],
)
def test_wrong_addresses_are_refused(url, where):
    with pytest.raises(ConfigError) as error:
        parse_address(url, {})
    assert error.value.where == where
    assert error.value.cure
    assert "hunter2" not in str(error.value)


def test_key_with_a_pass_phrase_is_an_error_and_asks_no_question(tmp_path):
    key, certificate = tmp_path / "key.pem", tmp_path / "cert.pem"
    command = (
        *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-days", "2", "-subj", "/CN=localhost"),
        *("-passout", "pass:secret", "-keyout", str(key), "-out", str(certificate)),
    )
    subprocess.run(command, check=True, capture_output=True)
    with pytest.raises(ConfigError) as error:
        parse_address(f"mqtts://broker?cert_file={certificate}&key_file={key}", {})
    assert (error.value.where, error.value.value) == ("--publish: key_file", str(key))
    assert error.value.cure
