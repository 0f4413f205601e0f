import pytest

from gridpeers.wire.text_file import TextFileError, read_table_text, text_of

ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"]


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends_that_the_bytes_tell_are_read(encoding: str, end: str) -> None:
    """UTF-8 or UTF-16, with or without a mark; line ends of Unix, Windows and old Macs."""
    assert text_of(f'name = "süd"{end}seed = 1{end}'.encode(encoding)) == 'name = "süd"\nseed = 1\n'


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "cp850"])
def test_bytes_of_a_code_page_are_named_with_their_line(encoding: str) -> None:
    """Which letter a byte of a code page stands for cannot be known."""
    with pytest.raises(TextFileError, match=r"^line 2 has byte 0x.., which is not UTF-8 .*; save it as UTF-8$"):
        text_of("a\nsüd".encode(encoding))


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
def test_any_separator_is_read(separator: str) -> None:
    """The separator of a spreadsheet depends on its country."""
    lines = [separator.join(cells) for cells in (["bus", "kW"], ['"a,b;c"', "1.5"])]

    table = read_table_text("\n".join(lines).encode(), ["bus", "kW"], ["kW"])

    assert table == (["bus", "kW"], [(2, ["a,b;c", "1.5"])])


def test_decimal_commas_are_points_where_numbers_stand() -> None:
    """A comma in a name stays. One cell whose comma cannot separate thousands decides for its column."""
    data = b"bus;kW;kvar\n1,5;12,5;1,500\n2;-0,3e2;7\n"

    assert read_table_text(data, ["bus", "kW", "kvar"], ["kW", "kvar"]).rows == [
        (2, ["1,5", "12.5", "1.500"]),
        (3, ["2", "-0.3e2", "7"]),
    ]


def test_decimal_commas_of_one_column_are_no_separators() -> None:
    """With the comma as separator, 12 ms would be read as 0, without an error."""
    assert read_table_text(b"delay_s\n0,012\n0,5\n", ["delay_s"], ["delay_s"]).rows == [(2, ["0.012"]), (3, ["0.5"])]


@pytest.mark.parametrize(("rows", "said"), [
    ("a;1,500\nb;20", r'^"1,500" \(row 2\) has a comma for decimals or thousands; write it with a point'),
    ("a;1,5\nb;1.5", r'^has decimal commas, "1,5" \(row 2\), and points, "1.5" \(row 3\); write all numbers'),
    ("a;1,5\nb;1.500,5", r'^has decimal commas, "1,5" \(row 2\), and points, "1.500,5" \(row 3\)'),
    ('a;"1', "^not a CSV file"),
])  # fmt: skip
def test_a_number_with_two_meanings_is_refused_in_one_line(rows: str, said: str) -> None:
    """1,500 is 1.5 in Germany and 1500 in England; a wrong load would be silent."""
    with pytest.raises(TextFileError, match=said):
        read_table_text(f"bus;kW\n{rows}\n".encode(), ["bus", "kW"], ["kW"])
