/* SPDX-License-Identifier: MIT */
/* Diagnostics of a table's rows have places, texts and an order, and make values unsound. */
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/given.h"
#include "tests/unit/shelf_rig.h"

#include <stdio.h>

/* ---- sound */

static int is_sound(const char *path, uint32_t item)
{
    return cfg_are_sound(&rd, item, &path, 1);
}

/* A diagnostic of a key makes unsound the key, the sections around it and what lies in it. */
static void a_diagnostic_reaches_sections_and_elements(void **state)
{
    (void)state;
    rd.bad[WEIGHT][1] = 1;
    assert_true(!is_sound("tins[].weight_kg", 1) && !is_sound("tins[]", 1) && !is_sound("tins", 0));
    assert_true(is_sound("tins[].weight_kg", 0) && is_sound("tins[]", 0) && is_sound("tins[].name", 1));
    assert_true(is_sound("head", 0) && is_sound("head.high_m", 0));
    assert_true(CFG_SOUND(&rd, "head", "head.locked") && !CFG_SOUND(&rd, "head", "tins"));
    rd.bad[WEIGHT][1] = 0;
    rd.bad[TIN][2] = 1;
    assert_true(!is_sound("tins[].name", 2) && is_sound("tins[].name", 1) && !is_sound("tins", 0));
    rd.bad[TIN][2] = 0;
    rd.bad[HEAD][0] = 1;
    assert_true(!is_sound("head.high_m", 0) && !is_sound("head.high_m", 3) && is_sound("tins", 0));
}

/* A key gets one diagnostic, since those that follow may be its consequence. */
static void a_key_has_one_diagnostic(void **state)
{
    (void)state;
    rd.line[TIN][2] = 7;
    assert_int_equal(cfg_fail_item(&rd, "tins[].name", 2, "%d letters", 9), SH_EINPUT);
    expect_last("shelf.yaml:7: tins[2].name: 9 letters");
    assert_int_equal(cfg_fail_item(&rd, "tins[].name", 2, "again"), SH_EINPUT);
    assert_int_equal(found.n, 1);
    assert_int_equal(cfg_fail_item(&rd, "tins[].name", 1, "empty"), SH_EINPUT);
    assert_int_equal(found.n, 2);
    assert_string_equal(found.err[0].text, "shelf.yaml:1: tins[1].name: empty"); /* that of the first line */
    rd.bad[HEAD][0] = 1;
    assert_int_equal(cfg_fail_key(&rd, "head.high_m", "too high"), SH_EINPUT);
    assert_int_equal(found.n, 2);
    assert_int_equal(cfg_fail_key(&rd, "tins", "wrong"), SH_EINPUT);
    assert_int_equal(found.n, 3);
}

static void the_place_of_a_diagnostic(void **state)
{
    (void)state;
    cfg_fail_file(&rd, SH_EINPUT, 0, "no file");
    expect_last("shelf.yaml: no file");
    cfg_fail_file(&rd, SH_EINPUT, 4, "no %s", "list");
    expect_last("shelf.yaml:4: no list");
    cfg_fail(&rd, 5, "tins", "none");
    expect_last("shelf.yaml:5: tins: none");
    cfg_fail(&rd, CFG_FROM_SET, "tins", "few");
    expect_last("--set tins: few");
    rd.set = "tins[0]";
    cfg_fail(&rd, CFG_FROM_SET, "tins[0].name", "short");
    expect_last("--set tins[0].name: short");
    cfg_fail_file(&rd, SH_EINPUT, 3, "no YAML");
    assert_string_equal(found.err[3].text, "--set tins[0]: character 3 of the value: no YAML");
    rd.set = NULL;
    cfg_fail_value(&rd, &keys[NAME], 3, 6, "long");
    assert_string_equal(found.err[3].text, "shelf.yaml:6: tins[3].name: long"); /* before those of --set */
    assert_int_equal(rd.bad[NAME][3], 1);
    assert_int_equal(cfg_fail_file(&rd, SH_ENOMEM, 8, "no memory"), SH_ENOMEM);
    assert_int_equal(found.n, 8);
    assert_int_equal(found.err[3].code, SH_EINPUT);
    assert_int_equal(found.err[4].code, SH_ENOMEM);
}

static void a_diagnostic_is_one_line(void **state)
{
    (void)state;
    cfg_fail(&rd, 1, "a\nb", "c\x1f\x7f~ %s", "d\t");
    expect_last("shelf.yaml:1: a?b: c??~ d?");
}

/* The file's key contradicts one of the scanner's. */
static void the_scanner_of_a_diagnostic(void **state)
{
    (void)state;
    rd.scanner = 1;
    cfg_fail_key(&rd, "head.high_m", "too high");
    expect_last("shelf.yaml:1: head.high_m, for stations[1].scanner: too high");
    rd.own[LOCKED] = 1;
    cfg_fail_key(&rd, "head.locked", "open");
    expect_last("shelf.yaml:1: stations[1].scanner.head.locked: open");
}

/* Up to 20 are kept, in the order of their places; those of one place in the order in which they came. */
static void diagnostics_are_in_order(void **state)
{
    (void)state;
    char text[32];
    for (int i = 0; i < CONFIG_MAX_DIAGNOSTICS; i++) {
        snprintf(text, sizeof text, "%d", i);
        assert_int_equal(cfg_add_diagnostic(&found, 10 + (uint64_t)(i % 5), SH_EINPUT, text), SH_EINPUT);
    }
    for (int i = 0; i < CONFIG_MAX_DIAGNOSTICS; i++) {
        assert_int_equal(found.place[i], 10 + i / 4);
        assert_int_equal(atoi(found.err[i].text), i / 4 + 5 * (i % 4));
    }
    cfg_add_diagnostic(&found, 14, SH_EINPUT, "last"); /* there is no room */
    assert_string_equal(found.err[CONFIG_MAX_DIAGNOSTICS - 1].text, "19");
    cfg_add_diagnostic(&found, 13, SH_ENOMEM, "later"); /* the last one makes room */
    assert_string_equal(found.err[16].text, "later");
    assert_int_equal(found.err[16].code, SH_ENOMEM);
    assert_int_equal(found.place[16], 13);
    assert_string_equal(found.err[CONFIG_MAX_DIAGNOSTICS - 1].text, "14");
    assert_int_equal(found.n, CONFIG_MAX_DIAGNOSTICS + 2);
}

/* ---- unknown keys */

static void expect_unknown(const char *parent, uint32_t item, const char *word, const char *text)
{
    memset(&found, 0, sizeof found);
    cfg_fail_unknown(&rd, 3, parent, item, word);
    expect_last(text);
}

static void an_unknown_key_gets_the_nearest_one(void **state)
{
    (void)state;
    expect_unknown("", 0, "had", "shelf.yaml:3: had: unknown key, did you mean head? allowed head, tins");
    assert_int_equal(rd.bad[HEAD][0], 1);
    expect_unknown(
        "tins[]", 2, "nane",
        "shelf.yaml:3: tins[2].nane: unknown key, did you mean tins[2].name? allowed weight_kg, name, label");
    assert_int_equal(rd.bad[NAME][2], 1);
    assert_int_equal(rd.bad[NAME][0], 0);
    /* the beginning of a key, and a key with something after it */
    expect_unknown(
        "tins[]", 0, "wei",
        "shelf.yaml:3: tins[0].wei: unknown key, did you mean tins[0].weight_kg? allowed weight_kg, name, label");
    expect_unknown("head", 0, "high_metre",
                   "shelf.yaml:3: head.high_metre: unknown key, did you mean head.high_m? allowed high_m, locked");
    expect_unknown("tins[]", 0, "we", "shelf.yaml:3: tins[0].we: unknown key; allowed weight_kg, name, label");
    /* the same word elsewhere; one that is near here comes first */
    expect_unknown("head", 0, "weight_kg",
                   "shelf.yaml:3: head.weight_kg: unknown key, did you mean tins[0].weight_kg? allowed high_m, locked");
    expect_unknown("tins[]", 1, "head",
                   "shelf.yaml:3: tins[1].head: unknown key, did you mean head at the top of the file? allowed "
                   "weight_kg, name, label");
    memset(&found, 0, sizeof found);
    cfg_fail_unknown(&rd, CFG_FROM_SET, "tins[]", 1, "head"); /* a --set has no top of a file */
    expect_last("--set tins[1].head: unknown key, did you mean head? allowed weight_kg, name, label");
    expect_unknown("", 0, "locked", "shelf.yaml:3: locked: unknown key, did you mean head.locked? allowed head, tins");
    expect_unknown("head", 0, "colour", "shelf.yaml:3: head.colour: unknown key; allowed high_m, locked");
    expect_unknown("", 0, "xyzhead", "shelf.yaml:3: xyzhead: unknown key; allowed head, tins"); /* three letters more */
    expect_unknown("", 0, "tn", "shelf.yaml:3: tn: unknown key; allowed head, tins");           /* 2 of 4 are missing */
    rd.of = "cellar";
    expect_unknown("", 0, "colour", "shelf.yaml:3: cellar.colour: unknown key; allowed head, tins");
}

/* A hostile file has thousands; the table is not searched for each. */
static void of_many_unknown_keys_the_last_get_nothing(void **state)
{
    (void)state;
    found.n = 10 * CONFIG_MAX_DIAGNOSTICS - 1;
    memset(found.place, 0xff, sizeof found.place);
    cfg_fail_unknown(&rd, 3, "", 0, "colour");
    assert_string_equal(found.err[0].text, "shelf.yaml:3: colour: unknown key; allowed head, tins");
    cfg_fail_unknown(&rd, 2, "", 0, "colour");
    assert_string_equal(found.err[0].text, "shelf.yaml:2: configuration: unknown key");
}

static void what_is_shown_fits_a_line(void **state)
{
    (void)state;
    char buf[CFG_SHOW_MAX], text[80];
    assert_string_equal(cfg_show("", buf), "");
    memset(text, 'x', sizeof text);
    text[60] = '\0';
    assert_string_equal(cfg_show(text, buf), text);
    text[60] = 'x';
    text[61] = '\0';
    cfg_show(text, buf);
    assert_true(strlen(buf) == CFG_SHOW_MAX - 1 && strncmp(buf, text, 60) == 0 && strcmp(buf + 60, "...") == 0);
    memcpy(text + 58, "\xe2\x82\xac\xe2\x82\xac", 7); /* two signs of 3 bytes: the first isn't cut within */
    cfg_show(text, buf);
    assert_true(strlen(buf) == 61 && strncmp(buf, text, 58) == 0 && strcmp(buf + 58, "...") == 0);
}

#define EACH(test) cmocka_unit_test_setup(test, begin)

int main(void)
{
    const struct CMUnitTest tests[] = {
        EACH(a_diagnostic_reaches_sections_and_elements),
        EACH(a_key_has_one_diagnostic),
        EACH(the_place_of_a_diagnostic),
        EACH(a_diagnostic_is_one_line),
        EACH(the_scanner_of_a_diagnostic),
        EACH(diagnostics_are_in_order),
        EACH(an_unknown_key_gets_the_nearest_one),
        EACH(of_many_unknown_keys_the_last_get_nothing),
        EACH(what_is_shown_fits_a_line),
    };
    return cmocka_run_group_tests_name("diagnostics of a table", tests, NULL, NULL);
}
