/* SPDX-License-Identifier: MIT */
/* The configuration table itself: its reference, its example, and the soundness of its rows. */
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/reference.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "tests/unit/config_rig.h"

#include <glob.h>

static void the_reference_names_every_key(void **state)
{
    (void)state;
    char *text = NULL, line[CFG_PATH_MAX + 2];
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    config_print_reference(out);
    fclose(out);
    char *joined = strdup(text); /* help texts are wrapped */
    for (char *at = joined; (at = strstr(at, "\n    ")) != NULL;) {
        memmove(at + 1, at + 5, strlen(at + 5) + 1);
        *at = ' ';
    }
    const struct cfg_table *tables[] = {&cfg_config_table, &cfg_profile_table};
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            const struct cfg_key *key = &tables[t]->keys[i];
            snprintf(line, sizeof line, "\n%s\n", key->path);
            if (strstr(text, line) == NULL || strstr(joined, key->help) == NULL) fail_msg("%s is not there", key->path);
        }
    free(text);
    free(joined);
}

static void rows_are_sound(void **state)
{
    (void)state;
    char line[CFG_PATH_MAX];
    const struct cfg_table *tables[] = {&cfg_config_table, &cfg_profile_table};
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            const struct cfg_key *key = &tables[t]->keys[i];
            int sized = key->type == CFG_MICRO || key->type == CFG_REAL  ? key->size == 8
                        : key->type == CFG_COUNT                         ? key->size == 4 || key->size == 8
                        : key->type == CFG_BOOL || key->type == CFG_ENUM ? key->size == sizeof(int)
                        : key->type == CFG_VEC3                          ? key->size == 3 * sizeof(double)
                        : key->type == CFG_PAIR                          ? key->size == 2 * sizeof(double)
                                                                         : 1;
            if (!sized) fail_msg("%s: its member has another size than its type", key->path);
            if (cfg_find(tables[t], key->path) != key) fail_msg("%s stands twice", key->path);
            if (key->def != NULL && key->def[0] == '@') assert_non_null(cfg_find(&cfg_profile_table, key->def + 1));
            if (key->max_key != NULL) assert_non_null(cfg_find(&cfg_profile_table, key->max_key));
            if (key->min_key != NULL) assert_non_null(cfg_find(&cfg_profile_table, key->min_key));
            if (strstr(key->path, "[]") != NULL) assert_non_null(cfg_list_of(tables[t], key));
            if (key->type == CFG_LIST) {
                snprintf(line, sizeof line, "%s[]", key->path);
                assert_ptr_equal(cfg_find(tables[t], line), key + 1);
            }
            assert_non_null(key->help);
        }
}

/* Returns the example as it is printed; free it. */
static char *print_example(void)
{
    char *text = NULL;
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    assert_int_equal(config_print_example(out, &err), SH_OK);
    fclose(out);
    return text;
}

/* A head has all protocols but capture, which belongs to `run FILE.pcap`. */
static void an_unknown_protocol_gets_those_of_heads(void **state)
{
    (void)state;
    const struct cfg_key *key = cfg_find(&cfg_config_table, "links[].protocol");
    assert_int_equal(load_set("links[0].protocol=x"), SH_EINPUT);
    char *heads = strdup(strstr(err.text, "allowed ") + strlen("allowed ")), *rest = strchr(heads, ';');
    assert_string_equal(rest, "; with `run FILE.pcap`: capture");
    *rest = '\0';
    for (size_t i = 0; key->names[i] != NULL; i++)
        assert_int_equal(cfg_list_has(heads, key->names[i]), strcmp(key->names[i], "capture") != 0);
    free(heads);
}

static void the_example_loads(void **state)
{
    (void)state;
    char *text = print_example();
    assert_loads(load_text(text));
    free(text);
}

/* "# word" is a comment. Between # and a key that is commented out there is no blank, or there are several. */
static int is_comment(const char *line)
{
    return line[1] == ' ' && line[2] != ' ';
}

/* Without the # of the first column it is a file with every key, each with a value that can be read. */
static void the_example_has_every_key(void **state)
{
    (void)state;
    static struct cfg_reader rd;
    char *text = print_example(), *to = text;
    for (const char *from = text; *from != '\0'; from++)
        if (*from != '#' || (from > text && from[-1] != '\n') || is_comment(from)) *to++ = *from;
    *to = '\0';
    write_file(config_path, text, strlen(text));
    free(text);
    memset(&diagnostics, 0, sizeof diagnostics);
    memset(cfg, 0, sizeof *cfg);
    cfg_reader_init(&rd, config_path, &cfg_config_table, cfg, &diagnostics);
    assert_int_equal(cfg_read_file(&rd), SH_OK);
    if (diagnostics.n != 0) fail_msg("%s", diagnostics.err[0].text);
    for (size_t i = 0; i < cfg_config_table.n; i++)
        if (rd.line[i][0] == 0) fail_msg("%s is not in the example", cfg_config_table.keys[i].path);
}

static void a_section_has_its_keys(void **state)
{
    (void)state;
    char *text = NULL;
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    assert_int_equal(config_print_section("noise", out, &err), SH_OK);
    fclose(out);
    assert_int_equal(strncmp(text, "noise\n", 6), 0);
    assert_non_null(strstr(text, "\nnoise.ball.seed\n"));
    assert_null(strstr(text, "signal.model\n"));
    free(text);
    assert_int_equal(config_print_section("noises", stdout, &err), SH_EINPUT);
    assert_says("no section \"noises\", did you mean noise?; allowed head, scene, ");
    assert_int_equal(config_print_section("he", stdout, &err), SH_EINPUT); /* two letters are all of it */
    assert_says("no section \"he\"; allowed head, scene, ");
    assert_int_equal(config_print_section("", stdout, &err), SH_EINPUT);
}

/* A key of each type, and each way in which it may be left out. */
static void keys_are_described_whole(void **state)
{
    (void)state;
    static const struct {
        enum config_keys keys;
        const char *path, *what;
        int has_value, has_words;
    } rows[] = {
        {CONFIG_KEYS, "head", "section", 0, 0},
        {CONFIG_KEYS, "links", "list; allowed a list of 0 to 8; optional", 0, 0},
        {CONFIG_KEYS, "stations", "list; allowed a list of 1 to 64; required", 0, 0},
        {CONFIG_KEYS, "head.start", "switch; allowed on or off; default off", 1, 1},
        {CONFIG_KEYS, "head.ambiguity", "word; allowed none, folded, resolved; default none", 1, 1},
        {CONFIG_KEYS, "head.frames", "whole number; allowed a whole number, 0 to 1000000; default 1", 1, 0},
        {CONFIG_KEYS, "head.step_deg", "number, exact to 1e-6, deg; allowed 0.01 to 90 deg; optional", 1, 0},
        {CONFIG_KEYS, "head.range_min_m",
         "number, m; allowed range_min_m to range_max_m of the head profile, in m; default from the head profile, its "
         "range_min_m",
         1, 0},
        {CONFIG_KEYS, "head.prr_hz",
         "number, exact to 1e-6, Hz; allowed 1 to 10000000 Hz, within the limits of the head profile; default from the "
         "head profile, its prr_max_hz",
         1, 0},
        {CONFIG_KEYS, "stations[].name", "text; allowed text of 1 to 31 bytes; optional", 1, 0},
        {CONFIG_KEYS, "head.settings_file", "path; allowed a path of 1 to 511 bytes; optional", 1, 0},
        {CONFIG_KEYS, "output.colour_rgb", "three numbers; allowed [x, y, z], each 0 to 255; default [255, 255, 255]",
         1, 0},
        {CONFIG_KEYS, "output.colour_limits",
         "two numbers; allowed [low, high], each -1000000000 to 1000000000; optional", 1, 0},
        {CONFIG_KEYS, "fields[].points_m", "list of points, m; allowed [[x, y], ...], each -1000 to 1000 m; optional",
         1, 0},
        {CONFIG_KEYS, "faults[].grandmaster",
         "whole number; allowed 0x1 to 0xffffffffffffffff; default 0x00b0aefffe000002", 1, 0},
        {CONFIG_PROFILE_KEYS, "steps_per_turn",
         "whole number; allowed a whole number, 1 to 1000000; required with emitter: planar", 1, 0},
        {CONFIG_PROFILE_KEYS, "beams", "list; allowed a list of 0 to 128; required with emitter: beams", 0, 0},
        {CONFIG_PROFILE_KEYS, "beams[].offset_ns",
         "whole number, ns; allowed a whole number, 0 to 1000000000 ns; required", 1, 0},
    };
    struct config_key_text text;
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        size_t i = 0;
        while (config_describe_key(rows[k].keys, i, &text) && strcmp(text.path, rows[k].path) != 0)
            i++;
        assert_string_equal(text.path, rows[k].path);
        assert_string_equal(text.what, rows[k].what);
        assert_int_equal(text.has_value, rows[k].has_value);
        assert_int_equal(text.words != NULL, rows[k].has_words);
    }
    assert_int_equal(config_describe_key(CONFIG_KEYS, cfg_config_table.n, &text), 0);
    assert_int_equal(config_describe_key(CONFIG_PROFILE_KEYS, cfg_profile_table.n, &text), 0);
    assert_int_equal(config_describe_key(CONFIG_KEYS, cfg_config_table.n - 1, &text), 1);
}

/* Whether the error's list of allowed keys has the word, as a whole. */
static int allows(const char *word)
{
    char text[sizeof err.text + 2], part[CFG_PATH_MAX + 4];
    const char *list = strstr(err.text, "allowed ");
    if (list == NULL) return 0;
    snprintf(text, sizeof text, "%s,", list + strlen("allowed"));
    snprintf(part, sizeof part, " %s,", word);
    return strstr(text, part) != NULL;
}

static void expect_all_keys(const struct cfg_table *table, const char *section)
{
    for (size_t i = 0; i < table->n; i++) {
        const char *word = cfg_word_below(table->keys[i].path, section);
        if (word != NULL && !allows(word)) fail_msg("%s is not among the allowed keys: %s", word, err.text);
    }
}

/* The longest lists are those of the head's keys and of a profile's. */
static void an_unknown_key_gets_the_list_of_all(void **state)
{
    (void)state;
    for (size_t i = 0; i < cfg_config_table.n; i++) {
        const struct cfg_key *key = &cfg_config_table.keys[i];
        char section[CFG_PATH_MAX], set[CFG_PATH_MAX + 16];
        if (key->type != CFG_MAP || strcmp(key->path, "stations[].scanner") == 0) continue; /* it has sections */
        snprintf(set, sizeof set, "%s.zzz=1", cfg_name(key->path, 0, section));
        assert_int_equal(load_set(set), SH_EINPUT);
        expect_all_keys(&cfg_config_table, key->path);
    }
    assert_int_equal(load_set("zzz=1"), SH_EINPUT);
    expect_all_keys(&cfg_config_table, "");
    write_in("heads/mine.yaml", "zzz: 1\n");
    assert_int_equal(load_edited("any-rate", "heads/mine.yaml"), SH_EINPUT);
    for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS && strstr(err.text, "zzz") == NULL; i++)
        err = diagnostics.err[i];
    expect_all_keys(&cfg_profile_table, "");
}

static char *pages;

/* The text of all pages that explain keys. */
static void read_pages(void)
{
    static const char *const folders[] = {"config/*.md",         "config/*/*.md",     "drivers/*/*.md",
                                          "firmware_sim/*/*.md", "firmware_sim/*.md", "core/*/*.md"};
    size_t len = 0;
    FILE *all = open_memstream(&pages, &len);
    for (size_t i = 0; i < sizeof folders / sizeof folders[0]; i++) {
        glob_t found;
        assert_int_equal(glob(folders[i], 0, NULL, &found), 0);
        for (size_t k = 0; k < found.gl_pathc; k++) {
            FILE *page = fopen(found.gl_pathv[k], "r");
            assert_non_null(page);
            for (int c; (c = fgetc(page)) != EOF;)
                fputc(c, all);
            fclose(page);
        }
        globfree(&found);
    }
    fclose(all);
}

static int is_letter_of_key(char c)
{
    return c == '_' || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
}

/* Whether a page has the word, as a whole. */
static int is_on_a_page(const char *word)
{
    const size_t len = strlen(word);
    for (const char *at = pages; (at = strstr(at, word)) != NULL; at += len)
        if (at > pages && !is_letter_of_key(at[-1]) && !is_letter_of_key(at[len])) return 1;
    return 0;
}

/* A user who reads the pages meets each key there, and not only in `check --help`. */
static void every_key_is_on_a_page(void **state)
{
    (void)state;
    const struct cfg_table *tables[] = {&cfg_config_table, &cfg_profile_table};
    read_pages();
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            char path[CFG_PATH_MAX];
            snprintf(path, sizeof path, "%s", tables[t]->keys[i].path);
            const size_t len = strlen(path);
            if (len > 2 && strcmp(path + len - 2, "[]") == 0) path[len - 2] = '\0';
            const char *dot = strrchr(path, '.');
            if (!is_on_a_page(dot != NULL ? dot + 1 : path)) fail_msg("no page has %s", tables[t]->keys[i].path);
        }
    free(pages);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_unknown_key_gets_the_list_of_all),
        cmocka_unit_test(every_key_is_on_a_page),
        cmocka_unit_test(the_reference_names_every_key),
        cmocka_unit_test(rows_are_sound),
        cmocka_unit_test(an_unknown_protocol_gets_those_of_heads),
        cmocka_unit_test(the_example_loads),
        cmocka_unit_test(the_example_has_every_key),
        cmocka_unit_test(a_section_has_its_keys),
        cmocka_unit_test(keys_are_described_whole),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
