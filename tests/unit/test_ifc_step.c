/* SPDX-License-Identifier: MIT */
/* Records of STEP files and their attributes, one by one, and the index of an IFC file's records. */
#include "core/import/ifc/ifc_index.h"
#include "core/import/ifc/ifc_unit.h"
#include "tests/unit/scene_files.h"

#define HEAD "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n"
#define END  "ENDSEC;\nEND-ISO-10303-21;\n"

static struct sh_err err;

static struct text_span span(const char *of)
{
    return (struct text_span){of, strlen(of)};
}

static void expect_span(struct text_span got, const char *want)
{
    if (!text_is(got, want)) fail_msg("'%.*s' instead of '%s'", (int)got.n, got.p, want);
}

static struct text open_step(const char *text)
{
    struct text t;
    if (step_open(&t, write_text("a.ifc", text), &err) != SH_OK) fail_msg("%s", err.text);
    unlink(path);
    return t;
}

/* Blanks and line ends may stand between all parts. Statements without a number, and a ; within a text, are passed. */
static void records_follow_each_other(void **state)
{
    (void)state;
    static const struct {
        uint64_t id, line;
        const char *type, *args;
    } want[] = {{7, 5, "IFCWALL", "'a;b', (1., #2)"},
                {12, 6, "IFCSLAB", " $ , * "},
                {3, 9, "IFCDOOR", "'it''s; here'"},
                {900719925474099267, 10, "IFCBEAM", ""},
                {4, 11, "X", "'(', )"}};
    struct text t = open_step(
        HEAD "#7=IFCWALL('a;b', (1., #2));\n#12 \t=\r\n  IFCSLAB\n( $ , * ) ;\n"
             "#3=/* a comment; of\n two *//* one; more */IFCDOOR('it''s; here');#900719925474099267=IFCBEAM();"
             "\n#4=X('(', ));" END);
    struct step_record r;
    for (size_t i = 0; i < sizeof want / sizeof want[0]; i++) {
        assert_int_equal(step_next(&t, &r, &err), 1);
        assert_int_equal(r.id, want[i].id);
        assert_int_equal(r.line, want[i].line);
        expect_span(r.type, want[i].type);
        expect_span(r.args, want[i].args);
    }
    assert_int_equal(step_next(&t, &r, &err), 0);
    assert_int_equal(step_next(&t, &r, &err), 0);
    text_close(&t);
}

/* Each file has one wrong record, in line 6. */
static void what_is_no_record_is_named(void **state)
{
    (void)state;
    static const char form[] = "this is no record of the form #1= TYPE(...);";
    static const struct {
        const char *text, *what;
    } rows[] = {{"#=IFCWALL(1);", form},
                {"#5 6=IFCWALL(1);", form},
                {"#5IFCWALL(1);", form},
                {"#5=IFCWALL 1;", form},
                {"#5(=IFCWALL)1;", form},
                {"#5(=IFCWALL(1);", form},
                {"#5=IFCWALL(1)x;", form},
                {"#5x=IFCWALL(1);", form},
                {"#5=IFCWALL(1)", "a record without its ';'"},
                {"#5=IFCWALL('1);", "a text without an end"},
                {"/*#5=IFCWALL(1);", "a comment without an end"}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[256], want[160];
        struct text t;
        struct step_record r;
        snprintf(text, sizeof text, HEAD "#1=IFCSLAB(2);\n%s\n", rows[i].text);
        int rc = step_open(&t, write_text("a.ifc", text), &err);
        while (rc == SH_OK && (rc = step_next(&t, &r, &err)) == 1)
            rc = SH_OK;
        assert_int_equal(rc, SH_EINPUT);
        snprintf(want, sizeof want, "%s, line 6: not STEP: %s", path, rows[i].what);
        assert_string_equal(err.text, want);
        text_close(&t);
        unlink(path);
    }
    struct text t;
    assert_int_equal(step_open(&t, write_text("a.ifc", HEAD "/* a\n\n b */#1=A('1);\n"), &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "a.ifc, line 7: not STEP: a text without an end"));
    text_close(&t);
    t = open_step("ISO-10303-21");
    text_close(&t);
    assert_int_equal(step_open(&t, write_text("a.ifc", "ISO-10303-2"), &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "a.ifc, line 1: not STEP: it doesn't begin with ISO-10303-21"));
    text_close(&t);
    unlink(path);
}

static void lists_are_split(void **state)
{
    (void)state;
    struct text_span part[4] = {{0}};
    assert_int_equal(step_split(span(""), part, 4), 0);
    assert_int_equal(step_split(span(" \n"), part, 4), 0);
    assert_int_equal(step_split(span("$"), part, 4), 1);
    expect_span(part[0], "$");
    assert_int_equal(step_split(span(" a , (b,(c),d) ,,'e,''f)' "), part, 4), 4);
    expect_span(part[0], "a");
    expect_span(part[1], "(b,(c),d)");
    expect_span(part[2], "");
    expect_span(part[3], "'e,''f)'");
    assert_int_equal(step_split(span("1,2,3"), part, 2), 3); /* two are stored */
    expect_span(part[0], "1");
    expect_span(part[1], "2");
    expect_span(part[2], "");
    struct text_span inside = {0};
    assert_true(step_list(span("(a, b)"), &inside));
    expect_span(inside, "a, b");
    assert_true(step_list(span("()"), &inside));
    expect_span(inside, "");
    static const char *const none[] = {"", "(", ")", "a", "(a", "a)"};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; i++)
        assert_false(step_list(span(none[i]), &inside));
}

static void numbers_fill_their_attribute(void **state)
{
    (void)state;
    struct text t = open_step(HEAD END);
    long whole = -1;
    double real = -1;
    uint64_t id = 99;
    assert_true(step_integer(span("0"), &whole) && whole == 0);
    assert_true(step_integer(span("-12"), &whole) && whole == -12);
    assert_true(step_integer(span("+9"), &whole) && whole == 9);
    assert_true(step_integer(span("123456789012345678"), &whole) && whole == 123456789012345678);
    static const char *const no_integer[] = {"", "-", "+", "1.", "1 ", "/", ":", "1234567890123456789", "--1"};
    for (size_t i = 0; i < sizeof no_integer / sizeof no_integer[0]; i++)
        if (step_integer(span(no_integer[i]), &whole)) fail_msg("'%s' is an integer", no_integer[i]);
    assert_true(step_reference(span("#5"), &id) && id == 5);
    assert_true(step_reference(span("#0"), &id) && id == 0);
    static const char *const no_reference[] = {"", "#", "5", "#-1", "#a", "$"};
    for (size_t i = 0; i < sizeof no_reference / sizeof no_reference[0]; i++)
        if (step_reference(span(no_reference[i]), &id)) fail_msg("'%s' is a reference", no_reference[i]);
    assert_true(step_real(&t, span("0.3048"), &real) && real == 0.3048);
    assert_true(step_real(&t, span("-1.5E-2"), &real) && real == -0.015);
    assert_true(step_real(&t, (struct text_span){"12.5", 4}, &real) && real == 12.5);
    static const char *const no_real[] = {"", "1.5 ", "1e400", "nan", "inf", "0x1", "1,5", "1.5.", "."};
    for (size_t i = 0; i < sizeof no_real / sizeof no_real[0]; i++)
        if (step_real(&t, span(no_real[i]), &real)) fail_msg("'%s' is a number", no_real[i]);
    text_close(&t);
}

static int open_index(struct ifc_index *x, const char *text)
{
    const int rc = ifc_index_open(x, write_text("a.ifc", text), &err);
    unlink(path);
    return rc;
}

static void records_are_found_by_number(void **state)
{
    (void)state;
    struct ifc_index x;
    if (open_index(&x, HEAD "#30=IFCWALL(#2,'#99');\n#2=IFCSLAB(#5, #2);\n#5=IFCDOOR(1);\n" END) != SH_OK)
        fail_msg("%s", err.text);
    assert_int_equal(x.n, 3);
    for (uint64_t id = 0; id < 40; id++) {
        const struct step_record *r = ifc_index_find(&x, id);
        assert_int_equal(r != NULL, id == 2 || id == 5 || id == 30);
        if (r != NULL) assert_int_equal(r->id, id);
        const size_t first = id <= 2 ? 0 : id <= 5 ? 1 : id <= 30 ? 2 : 3;
        assert_int_equal(ifc_first(x.record, x.n, sizeof *x.record, id), first);
    }
    const struct step_record *door = ifc_index_follow(&x, span("#5"), "IFCDOOR");
    assert_true(door != NULL && door->id == 5 && door->line == 7);
    assert_null(ifc_index_follow(&x, span("#5"), "IFCWALL"));
    assert_null(ifc_index_follow(&x, span("#6"), "IFCDOOR"));
    assert_null(ifc_index_follow(&x, span("5"), "IFCDOOR"));
    assert_int_equal(ifc_index_fail(&x, door, &err, "is shut"), SH_EINPUT);
    assert_non_null(strstr(err.text, "a.ifc, line 7: IFCDOOR #5: is shut"));
    const char list[] = "'#7', #12345, $, (#3), #", *p = list;
    uint64_t id;
    for (size_t i = 0; i < 3; i++) {
        assert_true(ifc_next_reference(&p, list + sizeof list - 1, &id));
        assert_int_equal(id, ((const uint64_t[]){12345, 3, 0})[i]);
    }
    assert_false(ifc_next_reference(&p, list + sizeof list - 1, &id));
    ifc_index_close(&x);
}

static void expect_refusal(const char *text, const char *what)
{
    struct ifc_index x;
    assert_int_equal(open_index(&x, text), SH_EINPUT);
    if (strstr(err.text, what) == NULL) fail_msg("%s without '%s'", err.text, what);
    ifc_index_close(&x);
}

static void a_broken_index_is_named(void **state)
{
    (void)state;
    expect_refusal(HEAD "#1=A();\n#2=A();\n#1=B();\n" END, "line 7: a second record #1; allowed one");
    expect_refusal(HEAD "#1=A();\n#1=B();\n" END, "line 6: a second record #1; allowed one");
    expect_refusal(HEAD "#1=A(#2);\n#2=B(#3);\n" END, "line 6: B #2 refers to #3, but there is no such record");
    expect_refusal(HEAD "#1=A(2,#);\n" END, "line 5: A #1 refers to #0, but there is no such record");
}

/* A record beyond the index's end is none of it. */
static void a_project_is_one_of_the_records(void **state)
{
    (void)state;
    struct ifc_index x;
    double m;
    assert_int_equal(open_index(&x, HEAD "#1=IFCWALL();\n#2=IFCPROJECT();\n#3=IFCPROJECT();\n" END), SH_OK);
    for (size_t n = 0; n < 4; n++) {
        char says[80];
        x.n = n;
        assert_int_equal(ifc_unit_find(&x, &m, &err), SH_EINPUT);
        if (n == 2)
            snprintf(says, sizeof says, "IFCPROJECT #2: not the 9 attributes that IFC defines");
        else
            snprintf(says, sizeof says, "a.ifc: %d IFCPROJECT records; allowed one", n < 3 ? 0 : 2);
        if (strstr(err.text, says) == NULL) fail_msg("%s without '%s'", err.text, says);
    }
    ifc_index_close(&x);
}

/* The file's end is looked for in its last kilobyte. */
static void the_end_is_near(void **state)
{
    (void)state;
    static const char last[] = "END-ISO-10303-21;";
    static char text[4096];
    for (int size = 900; size <= 2000; size += size < 1020 || size >= 1030 ? 60 : 1)
        for (int after = 1023; after <= 1026; after++) { /* bytes from the first one of `last` to the file's end */
            const int end = size > after + 40 ? size - after : 100;
            struct ifc_index x;
            memset(text, '\n', sizeof text);
            memcpy(text, HEAD, sizeof HEAD - 1);
            memcpy(text + end, last, sizeof last - 1);
            text[size] = '\0';
            const int is_found = size - end <= 1024;
            assert_int_equal(open_index(&x, text), is_found ? SH_OK : SH_EINPUT);
            if (!is_found) assert_non_null(strstr(err.text, "a.ifc: cut off: it doesn't end with END-ISO-10303-21;"));
            ifc_index_close(&x);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(records_follow_each_other),
        cmocka_unit_test(what_is_no_record_is_named),
        cmocka_unit_test(lists_are_split),
        cmocka_unit_test(numbers_fill_their_attribute),
        cmocka_unit_test(records_are_found_by_number),
        cmocka_unit_test(a_broken_index_is_named),
        cmocka_unit_test(a_project_is_one_of_the_records),
        cmocka_unit_test(the_end_is_near),
    };
    return cmocka_run_group_tests_name("ifc_step", tests, make_folder, remove_folder);
}
