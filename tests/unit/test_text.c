/* SPDX-License-Identifier: MIT */
/* Reading text: words, lines, numbers, characters, and the place that a message names. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/infile.h"
#include "core/text.h"
#include "core/utf8.h"
#include "tests/unit/file_rig.h"
#include "tests/common/cases.h"

static struct text t;
static struct sh_err err;

static void write_file(const char *bytes, size_t n)
{
    FILE *file = fopen(file_path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, n, file), n);
    assert_int_equal(fclose(file), 0);
}

static void open_text(const char *text)
{
    write_file(text, strlen(text));
    assert_int_equal(text_open(&t, file_path, NULL, NULL, &err), SH_OK);
}

static void expect_word(const char *want)
{
    const struct text_span word = text_word(&t);
    if (!text_is(word, want)) fail_msg("\"%.*s\" instead of \"%s\"", (int)word.n, word.p, want);
}

/* Lines end with LF, CR LF or CR. Words are apart by blanks. */
static void words_and_lines(void **state)
{
    (void)state;
    open_text("\xef\xbb\xbfone  two\t\v\fthree\r\n four\rfive six \n\n\\seven\n");
    assert_int_equal(t.line, 1);
    expect_word("one");
    assert_true(text_at_word_end(&t) && !text_at_line_end(&t));
    expect_word("two");
    expect_word("three");
    assert_true(text_at_line_end(&t) && text_at_word_end(&t));
    expect_word(""); /* there is none on this line */
    assert_int_equal(t.line, 1);
    text_next_line(&t);
    assert_int_equal(t.line, 2);
    assert_false(text_at_word_end(&t) && text_at_line_end(&t));
    expect_word("four");
    text_next_line(&t);
    assert_int_equal(t.line, 3);
    text_next_line(&t); /* whatever is on it */
    assert_int_equal(t.line, 4);
    assert_true(text_at_line_end(&t));
    text_next_line(&t);
    expect_word("\\seven"); /* no line is continued here */
    assert_int_equal(t.line, 5);
    text_next_line(&t);
    assert_int_equal(t.line, 6);
    assert_true(t.p == t.end && text_at_line_end(&t) && text_at_word_end(&t));
    text_next_line(&t); /* there is no further line */
    assert_int_equal(t.line, 6);
    text_close(&t);
}

/* A backslash before the line's end, and not elsewhere, joins the next line. */
static void continued_lines(void **state)
{
    (void)state;
    open_text("a \\\n b\\\r\nc \\ d\\e\\\r f\\");
    t.continued = true;
    expect_word("a");
    expect_word("b");
    assert_int_equal(t.line, 2);
    assert_true(text_at_word_end(&t) && !text_at_line_end(&t));
    expect_word("c");
    assert_int_equal(t.line, 3);
    expect_word("\\");
    expect_word("d\\e");
    expect_word("f\\"); /* the end of the file is no line's end */
    assert_int_equal(t.line, 4);
    text_close(&t);
}

static void the_rest_of_a_line(void **state)
{
    (void)state;
    open_text("name \t a b  c \t\r\n   \nlast ");
    expect_word("name");
    assert_true(text_is(text_rest(&t), "a b  c"));
    text_next_line(&t);
    assert_true(text_is(text_rest(&t), ""));
    text_next_line(&t);
    assert_true(text_is(text_rest(&t), "last"));
    assert_true(t.p == t.end);
    text_close(&t);
}

static void texts_that_are_the_same(void **state)
{
    (void)state;
    static const char *const list[] = {"ab", "cd", NULL};
    const struct text_span ab = {"abc", 2};
    assert_true(text_is(ab, "ab") && !text_is(ab, "abc") && !text_is(ab, "a") && !text_is(ab, "AB"));
    assert_true(text_is_word(ab, "Ab") && !text_is_word(ab, "abc") && !text_is_word(ab, "ac"));
    assert_true(text_is_one_of(ab, list) && text_is_one_of(text_span_of("cd"), list));
    assert_false(text_is_one_of(text_span_of("a"), list) || text_is_one_of(ab, list + 1));
    assert_true(text_has_ending("a.PLY", ".ply") && !text_has_ending(".ply", ".ply") &&
                !text_has_ending("a.pl", ".ply"));
    static const char digits[] = "0123456789abcdefABCDEF";
    for (int i = 0; i < 22; i++)
        assert_int_equal(text_hex_digit(digits[i]), i < 16 ? i : i - 6);
    for (const char *c = "/:@G`g "; *c != '\0'; c++)
        assert_int_equal(text_hex_digit(*c), -1);
}

/* Each number is the nearest double, as the C library reads it. */
static void numbers_are_exact(void **state)
{
    (void)state;
    static const char *const texts[] = {"0",
                                        "-0",
                                        "+1",
                                        "-1.5",
                                        ".5",
                                        "5.",
                                        "-.25e1",
                                        "1e22",
                                        "1e-22",
                                        "1e23",
                                        "1e-23",
                                        "9007199254740992",
                                        "9007199254740993",
                                        "9007199254740993e-5",
                                        "123456789012345678",
                                        "1234567890123456789",
                                        "0.00000000000000000000001",
                                        "99999999999999999e-17",
                                        "100000000000000001",
                                        "2.2250738585072011e-308",
                                        "4.9e-324",
                                        "1.7976931348623157e308",
                                        "1e400",
                                        "-1e-400",
                                        "1E+5",
                                        "12e-3",
                                        "0.1",
                                        "3.14159265358979323846",
                                        "1e00000000000000000005",
                                        "nan",
                                        "inf",
                                        "-Infinity",
                                        "NAN",
                                        "000000000000000000000000000012.5"};
    uint64_t seed = 3;
    for (size_t i = 0; i < sizeof texts / sizeof texts[0] + 300; i++) {
        char text[64];
        double got;
        const size_t fixed = sizeof texts / sizeof texts[0];
        if (i < fixed)
            snprintf(text, sizeof text, "%s", texts[i]);
        else
            snprintf(text, sizeof text, "%s%llu.%0*llue%d", i % 2 ? "-" : "",
                     (unsigned long long)(case_u64(&seed) >> (i % 64)), (int)(i % 7),
                     (unsigned long long)(case_u64(&seed) % 1000000), (int)(i % 60) - 30);
        open_text(text);
        if (!text_number(&t, &got)) fail_msg("%s is not read", text);
        const double want = strtod(text, NULL);
        if (memcmp(&got, &want, sizeof got) != 0 && !(isnan(got) && isnan(want))) fail_msg("%s: %.17g", text, got);
        assert_true(t.p == t.end);
        text_close(&t);
    }
}

/* A number fills its word. Else the place does not move. */
static void what_is_no_number(void **state)
{
    (void)state;
    static const char *const texts[] = {"",   " 1",   "-",   "+",   ".",  "1e",   "1e+",  "1.2.3", "1m",
                                        "e5", "0x10", "1,2", "--1", "na", "info", "1e5x", "-x"};
    double value;
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        open_text(texts[i]);
        if (text_number(&t, &value)) fail_msg("\"%s\" is read as %g", texts[i], value);
        assert_true(t.p == t.data);
        text_close(&t);
    }
    open_text("1\\\n2");
    assert_false(text_number(&t, &value));
    t.continued = true;
    assert_true(text_number(&t, &value) && value == 1.0);
    text_close(&t);
}

static void integers(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int64_t value;
        size_t n; /* read; 0: it is none */
    } is[] = {{"0", 0, 1},
              {"-7/", -7, 2},
              {"+12x", 12, 3},
              {"999999999999999999", INT64_C(999999999999999999), 18},
              {"-999999999999999999", -INT64_C(999999999999999999), 19},
              {"1000000000000000000", 0, 0},
              {"", 0, 0},
              {"-", 0, 0},
              {"x", 0, 0},
              {"/1", 0, 0},
              {":1", 0, 0},
              {"9:", 9, 1}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        int64_t value = -1;
        open_text(is[i].text);
        assert_int_equal(text_integer(&t, &value), is[i].n > 0);
        assert_int_equal(t.p - t.data, is[i].n);
        assert_int_equal(value, is[i].n > 0 ? is[i].value : -1);
        text_close(&t);
    }
}

/* These are the last character of each length, the first one of each longer length, and codes that Unicode 15, table
 * 3-7, leaves out. */
static void characters_of_utf8(void **state)
{
    (void)state;
    static const struct {
        const char *bytes;
        int len;
    } is[] = {{"\x7f", 1},
              {"\x80", 0},
              {"\xbf", 0},
              {"\xc1\xbf", 0},
              {"\xc2\x80", 2},
              {"\xc2\x7f", 0},
              {"\xc2\xc0", 0},
              {"\xdf\xbf", 2},
              {"\xe0\x9f\xbf", 0},
              {"\xe0\xa0\x80", 3},
              {"\xe1\x80\x80", 3},
              {"\xec\xbf\xbf", 3},
              {"\xed\x9f\xbf", 3},
              {"\xed\xa0\x80", 0},
              {"\xee\x80\x80", 3},
              {"\xef\xbf\xbf", 3},
              {"\xef\xbf\xc0", 0},
              {"\xf0\x8f\xbf\xbf", 0},
              {"\xf0\x90\x80\x80", 4},
              {"\xf1\x80\x80\x80", 4},
              {"\xf3\xbf\xbf\xbf", 4},
              {"\xf4\x8f\xbf\xbf", 4},
              {"\xf4\x90\x80\x80", 0},
              {"\xf5\x80\x80\x80", 0},
              {"\xff", 0},
              {"\xe2\x82", 0}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        if (utf8_len(is[i].bytes, 4) != is[i].len) fail_msg("case %zu", i);
        for (int n = 0; n < is[i].len; n++) /* a character that is cut */
            assert_int_equal(utf8_len(is[i].bytes, (size_t)n), 0);
        assert_int_equal(utf8_len(is[i].bytes, (size_t)is[i].len), is[i].len > 0 ? is[i].len : 0);
    }
}

/* A text is cut before the character that n bytes would divide. Bytes that are no UTF-8 are cut at n. */
static void a_text_is_cut_between_characters(void **state)
{
    (void)state;
    static const char text[] = "a\xc3\xa9\xe2\x82\xac\xf0\x90\x80\x80"; /* characters of 1, 2, 3 and 4 bytes */
    static const size_t cut[] = {0, 1, 1, 3, 3, 3, 6, 6, 6, 6, 10};
    for (size_t n = 0; n < sizeof cut / sizeof cut[0]; n++)
        assert_int_equal(utf8_cut(text, n), cut[n]);
    assert_int_equal(utf8_cut("\x80\x80\x80\x80\x80\x80", 5), 5);
    assert_int_equal(utf8_cut("\x80\x80", 1), 1);
}

/* The message has the last 120 bytes of a long path. */
static void messages_name_a_place(void **state)
{
    (void)state;
    char longest[121], longer[122], want[256];
    memset(longest, 'p', 120);
    longest[120] = '\0';
    snprintf(longer, sizeof longer, "x%s", longest);
    t = (struct text){.path = longest};
    assert_int_equal(text_fail(&t, 7, SH_EFORMAT, &err, "%d things", 3), SH_EFORMAT);
    snprintf(want, sizeof want, "%s, line 7: 3 things", longest);
    assert_string_equal(err.text, want);
    t.path = longer;
    text_fail(&t, 1, SH_EINPUT, &err, "why");
    snprintf(want, sizeof want, "...%s, line 1: why", longest);
    assert_string_equal(err.text, want);
    text_fail(&t, 0, SH_EINPUT, &err, "why");
    snprintf(want, sizeof want, "...%s: why", longest);
    assert_string_equal(err.text, want);
}

static int count_parts(void *ctx, double fraction, struct sh_err *e)
{
    int *left = ctx;
    assert_true(fraction == -1.0);
    return --*left == 0 ? sh_fail(e, SH_ESTOPPED, "enough") : SH_OK;
}

/* Reading reports each 16 MiB, and ends where it is told to. */
static void large_files(void **state)
{
    (void)state;
    enum { SIZE = 17 << 20 };
    int left = 10;
    assert_int_equal(truncate(file_path, SIZE), 0);
    assert_int_equal(text_open(&t, file_path, count_parts, &left, &err), SH_OK);
    assert_int_equal(left, 8);
    assert_true(t.size == SIZE && t.end == t.data + SIZE && *t.end == '\0');
    text_close(&t);
    left = 1;
    assert_int_equal(text_open(&t, file_path, count_parts, &left, &err), SH_ESTOPPED);
    assert_string_equal(err.text, "enough");
    text_close(&t);
    assert_int_equal(truncate(file_path, 0), 0);
}

static void what_files_begin_with(void **state)
{
    (void)state;
    write_file("PK\3\4rest", 8);
    assert_int_equal(infile_begins(file_path, "PK\3\4"), 1);
    assert_int_equal(infile_begins(file_path, "PK\3\5"), 0);
    assert_int_equal(infile_begins(file_path, "PK\3\4rest"), 1);
    write_file("PK", 2);
    assert_int_equal(infile_begins(file_path, "PK\3\4"), 0); /* too short */
    assert_int_equal(infile_begins("/nonexistent/file", "P"), -1);
    assert_int_equal(text_open(&t, "/nonexistent/file", NULL, NULL, &err), SH_EINPUT);
    assert_string_equal(err.text, "/nonexistent/file: No such file or directory");
    text_close(&t);
    assert_int_equal(text_open(&t, "/tmp", NULL, NULL, &err), SH_EINPUT);
    assert_string_equal(err.text, "/tmp: a directory, not a file");
    text_close(&t);
    assert_int_equal(text_open(&t, "/dev/null", NULL, NULL, &err), SH_EINPUT);
    assert_string_equal(err.text, "/dev/null: a device, not a file");
    text_close(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_and_lines),
        cmocka_unit_test(continued_lines),
        cmocka_unit_test(the_rest_of_a_line),
        cmocka_unit_test(texts_that_are_the_same),
        cmocka_unit_test(numbers_are_exact),
        cmocka_unit_test(what_is_no_number),
        cmocka_unit_test(integers),
        cmocka_unit_test(characters_of_utf8),
        cmocka_unit_test(a_text_is_cut_between_characters),
        cmocka_unit_test(messages_name_a_place),
        cmocka_unit_test(large_files),
        cmocka_unit_test(what_files_begin_with),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
