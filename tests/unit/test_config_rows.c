/* SPDX-License-Identifier: MIT */
/* A table finds its rows by their paths. Its reader knows where each was given, fills in defaults and drops values. */
#include "firmware_sim/config/limits.h"
#include "firmware_sim/config/table/forget.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/value.h"
#include "tests/unit/shelf_rig.h"

/* ---- paths */

static void rows_are_found_by_their_paths(void **state)
{
    (void)state;
    for (size_t i = 0; i < ROWS; i++) {
        assert_ptr_equal(cfg_find(&table, keys[i].path), &keys[i]);
        assert_int_equal(cfg_row(&rd, &keys[i]), i);
        assert_ptr_equal(cfg_list_of(&table, &keys[i]), i >= TIN ? &keys[TINS] : NULL);
    }
    assert_null(cfg_find(&table, "tins[].weight"));
    assert_null(cfg_find(&table, "tins[].weight_kg."));
}

static void a_path_is_cut_to_the_section_around_it(void **state)
{
    (void)state;
    static const char *const steps[] = {"tins[].label.text", "tins[].label", "tins[]", "tins", "", ""};
    char path[CFG_PATH_MAX];
    strcpy(path, steps[0]);
    for (size_t i = 1; i < sizeof steps / sizeof steps[0]; i++) {
        cfg_cut_to_parent(path);
        assert_string_equal(path, steps[i]);
    }
    strcpy(path, "[]");
    cfg_cut_to_parent(path);
    assert_string_equal(path, "");
}

static void what_is_in_a_section(void **state)
{
    (void)state;
    assert_true(cfg_is_in("head", "head") && cfg_is_in("head.locked", "head") && cfg_is_in("tins[].name", "tins"));
    assert_true(cfg_is_in("tins[]", "tins[]") && cfg_is_in("tins[].name", "tins[]"));
    assert_false(cfg_is_in("heads", "head") || cfg_is_in("hea", "head") || cfg_is_in("head", "head.locked"));
    assert_string_equal(cfg_word_below("head.locked", "head"), "locked");
    assert_string_equal(cfg_word_below("tins[].name", "tins[]"), "name");
    assert_string_equal(cfg_word_below("head", ""), "head");
    assert_null(cfg_word_below("head", "head"));  /* nothing below */
    assert_null(cfg_word_below("head.", "head")); /* no word */
    assert_null(cfg_word_below("head.locked.x", "head"));
    assert_null(cfg_word_below("tins[]", "")); /* an element */
    assert_null(cfg_word_below("headlight", "head"));
    assert_null(cfg_word_below("tins[].name", "head"));
}

static void names_have_their_element(void **state)
{
    (void)state;
    char buf[CFG_PATH_MAX], full[2 * CFG_PATH_MAX];
    assert_string_equal(cfg_name("tins[].name", 12, buf), "tins[12].name");
    assert_string_equal(cfg_name("tins[]", 0, buf), "tins[0]");
    assert_string_equal(cfg_name("head.locked", 12, buf), "head.locked");
    assert_string_equal(cfg_full_name(&rd, &keys[NAME], 2, full), "tins[2].name");
    rd.of = "cellar";
    assert_string_equal(cfg_full_name(&rd, &keys[NAME], 2, full), "cellar.tins[2].name");
    rd.scanner = 3;
    rd.own[NAME] = 1;
    assert_string_equal(cfg_full_name(&rd, &keys[NAME], 2, full), "stations[3].scanner.tins[2].name");
}

static void lists_of_words(void **state)
{
    (void)state;
    static const char *const kinds[] = {"tin", "jar", "box", NULL};
    char buf[16] = "", five[6] = "";
    cfg_list_add(buf, sizeof buf, "a");
    cfg_list_add(buf, sizeof buf, "bc");
    assert_string_equal(buf, "a, bc");
    cfg_list_add(five, sizeof five, "abcd");
    cfg_list_add(five, sizeof five, "efg");
    assert_string_equal(five, "abcd,"); /* as far as it fits */
    assert_string_equal(cfg_list_kinds(CFG_KIND(0) | CFG_KIND(2), kinds, buf, sizeof buf), "tin, box");
    assert_string_equal(cfg_list_kinds(0, kinds, buf, sizeof buf), "");
    assert_true(cfg_list_has("a, bc", "a") && cfg_list_has("a, bc", "bc") && cfg_list_has("abc, b", "b"));
    assert_false(cfg_list_has("a, bc", "b") || cfg_list_has("a, bc", "c") || cfg_list_has(NULL, "a"));
    assert_false(cfg_list_has("", "a") || cfg_list_has("ab", "a"));
    assert_int_equal(cfg_axes(&(struct cfg_key){.type = CFG_PAIR}), 2);
    assert_int_equal(cfg_axes(&(struct cfg_key){.type = CFG_VEC3}), 3);
}

/* ---- where things are */

static void members_have_their_places(void **state)
{
    (void)state;
    shelf.n_tins = 3;
    assert_ptr_equal(cfg_address(&rd, &keys[HIGH], 5), &shelf.high_m);
    assert_ptr_equal(cfg_address(&rd, &keys[LOCKED], 0), &shelf.locked);
    assert_ptr_equal(cfg_address(&rd, &keys[WEIGHT], 0), &shelf.tin[0].weight_kg);
    assert_ptr_equal(cfg_address(&rd, &keys[NAME], 3), shelf.tin[3].name);
    assert_ptr_equal(cfg_list_count(&rd, &keys[TINS]), &shelf.n_tins);
}

static void a_line_is_that_of_the_key_or_of_what_is_around_it(void **state)
{
    (void)state;
    rd.root_line = 2;
    assert_int_equal(cfg_where(&rd, &keys[WEIGHT], 1), 2);
    rd.line[TINS][0] = 10;
    assert_int_equal(cfg_where(&rd, &keys[WEIGHT], 1), 10);
    rd.line[TIN][1] = 12;
    assert_int_equal(cfg_where(&rd, &keys[WEIGHT], 1), 12);
    assert_int_equal(cfg_where(&rd, &keys[WEIGHT], 0), 10);
    rd.line[WEIGHT][1] = CFG_FROM_SET;
    assert_int_equal(cfg_where(&rd, &keys[WEIGHT], 1), CFG_FROM_SET);
    assert_int_equal(cfg_where(&rd, &keys[NAME], 1), 12);
    assert_int_equal(cfg_where(&rd, &keys[HIGH], 0), 2);
    assert_true(cfg_is_item_given(&rd, "tins[].weight_kg", 1) && !cfg_is_item_given(&rd, "tins[].weight_kg", 0));
    assert_true(cfg_is_given(&rd, "tins") && !cfg_is_given(&rd, "head.high_m") && !cfg_is_given(&rd, "nothing"));
}

/* ---- defaults, and values that are dropped */

static void defaults_replace_what_is_not_given_or_bad(void **state)
{
    (void)state;
    shelf = (struct shelf){.high_m = 2.0, .n_tins = 2, .locked = 0};
    shelf.tin[0] = (struct tin){3.0, "soup"};
    rd.line[HIGH][0] = rd.line[WEIGHT][0] = rd.line[NAME][0] = 5;
    rd.line[TIN][1] = 6;
    cfg_fill_defaults(&rd, NULL);
    assert_true(shelf.high_m == 2.0 && shelf.locked == 1 && shelf.tin[0].weight_kg == 3.0);
    assert_string_equal(shelf.tin[0].name, "soup");
    assert_int_equal(found.n, 1);
    expect_last("shelf.yaml:6: tins[1].weight_kg: missing, and it has no default; allowed 0 to 10 kg");
    rd.bad[HIGH][0] = 1;
    cfg_fill_defaults(&rd, NULL);
    assert_true(shelf.high_m == 1.5 && found.n == 1);
    shelf.n_tins = 0;
    cfg_fill_defaults(&rd, NULL);
    assert_int_equal(found.n, 2);
    assert_string_equal(found.err[0].text,
                        "shelf.yaml:1: tins: missing, and it has no default; allowed a list of 1 to 4");
}

static void fill_shelf(void)
{
    begin(NULL);
    shelf = (struct shelf){.high_m = 2.0, .n_tins = 2, .locked = 1};
    for (uint32_t i = 0; i < 2; i++)
        shelf.tin[i] = (struct tin){1.0 + i, "a"};
    for (size_t row = 0; row < ROWS; row++)
        for (uint32_t i = 0; i < 2; i++) {
            rd.line[row][i] = 3;
            rd.bad[row][i] = 1;
        }
}

static void a_dropped_value_was_never_given(void **state)
{
    (void)state;
    fill_shelf();
    cfg_forget(&rd, &keys[TIN], 1);
    assert_true(shelf.n_tins == 2 && shelf.tin[0].weight_kg == 1.0 && shelf.tin[1].weight_kg == 0.0);
    assert_true(shelf.tin[1].name[0] == '\0' && shelf.tin[0].name[0] == 'a' && shelf.high_m == 2.0);
    for (size_t row = TIN; row < ROWS; row++)
        assert_true(rd.line[row][0] == 3 && rd.line[row][1] == 0 && rd.bad[row][0] == 1 && rd.bad[row][1] == 0);
    assert_true(rd.line[TINS][0] == 3 && rd.line[HEAD][0] == 3);
    fill_shelf();
    cfg_forget(&rd, &keys[TINS], 0);
    assert_true(shelf.n_tins == 0 && shelf.tin[0].weight_kg == 0.0 && shelf.tin[1].weight_kg == 0.0);
    for (size_t row = TINS; row < ROWS; row++)
        for (int i = 0; i < 2; i++)
            assert_true(rd.line[row][i] == 0 && rd.bad[row][i] == 0);
    assert_true(shelf.high_m == 2.0 && rd.line[HIGH][0] == 3);
    fill_shelf();
    cfg_forget(&rd, &keys[HEAD], 0);
    assert_true(shelf.high_m == 0.0 && shelf.locked == 0 && shelf.n_tins == 2 && shelf.tin[1].weight_kg == 2.0);
    assert_true(rd.line[HEAD][0] == 0 && rd.line[HIGH][0] == 0 && rd.bad[LOCKED][0] == 0 && rd.line[TINS][0] == 3);
}

/* A scanner's value replaces the file's. A list is replaced as a whole, and once. */
static void a_scanner_takes_keys_over(void **state)
{
    (void)state;
    fill_shelf();
    cfg_take_over(&rd, &keys[HIGH]);
    assert_true(rd.own[HIGH] == 1 && rd.own[LOCKED] == 0 && rd.line[HIGH][0] == 0 && rd.bad[HIGH][0] == 0);
    assert_true(rd.line[LOCKED][0] == 3 && shelf.n_tins == 2);
    rd.line[HIGH][0] = 9;
    cfg_take_over(&rd, &keys[HIGH]);
    assert_int_equal(rd.line[HIGH][0], 9);
    cfg_take_over(&rd, &keys[TINS]);
    assert_true(shelf.n_tins == 0 && rd.own[TINS] && rd.own[TIN] && rd.own[WEIGHT] && rd.own[NAME]);
    shelf.n_tins = 1;
    rd.line[WEIGHT][0] = 4;
    cfg_take_over(&rd, &keys[WEIGHT]); /* of the scanner's own list */
    assert_true(shelf.n_tins == 1 && rd.line[WEIGHT][0] == 4);
}

static void sections_of_a_scanner(void **state)
{
    (void)state;
    static const char *const its[] = {"head",   "head.prr_hz", "beam.mode",  "cast.sight", "plan",      "noise.ball",
                                      "signal", "surfaces",    "surfaces[]", "optics",     "instrument"};
    static const char *const not_its[] = {"head.station", "head.start", "cast.sight_mib", "scene",    "links[].type",
                                          "output",       "loop",       "heads",          "stations", "waveform"};
    for (size_t i = 0; i < sizeof its / sizeof its[0]; i++)
        if (!cfg_is_of_scanner(its[i])) fail_msg("%s", its[i]);
    for (size_t i = 0; i < sizeof not_its / sizeof not_its[0]; i++)
        if (cfg_is_of_scanner(not_its[i])) fail_msg("%s", not_its[i]);
}

/* A section has no value that a text could be. */
static void a_section_takes_no_text(void **state)
{
    (void)state;
    assert_int_equal(cfg_store(&rd, &keys[HEAD], 0, 4, "x", ""), SH_EINPUT);
    expect_last("shelf.yaml:4: head: \"x\" is not what belongs here; allowed a section with keys");
    assert_int_equal(rd.bad[HEAD][0], 1);
}

static void the_folder_of_a_path(void **state)
{
    (void)state;
    char buf[CONFIG_PATH_LEN];
    assert_string_equal(cfg_dir_of("a/b/c.yaml", buf), "a/b/");
    assert_string_equal(cfg_dir_of("c.yaml", buf), "");
    assert_string_equal(cfg_dir_of("/c.yaml", buf), "/");
}

#define EACH(test) cmocka_unit_test_setup(test, begin)

int main(void)
{
    const struct CMUnitTest tests[] = {
        EACH(rows_are_found_by_their_paths),
        EACH(a_path_is_cut_to_the_section_around_it),
        EACH(what_is_in_a_section),
        EACH(names_have_their_element),
        EACH(lists_of_words),
        EACH(members_have_their_places),
        EACH(a_line_is_that_of_the_key_or_of_what_is_around_it),
        EACH(defaults_replace_what_is_not_given_or_bad),
        EACH(a_dropped_value_was_never_given),
        EACH(a_scanner_takes_keys_over),
        EACH(sections_of_a_scanner),
        EACH(a_section_takes_no_text),
        EACH(the_folder_of_a_path),
    };
    return cmocka_run_group_tests_name("rows of a table", tests, NULL, NULL);
}
