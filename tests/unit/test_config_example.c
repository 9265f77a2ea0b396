/* SPDX-License-Identifier: MIT */
/* The reference and the example are read line by line: indents follow the depth of a key, texts are wrapped within 100
 * columns, values are defaults or figures of the profile, and few keys are not commented out. */
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/reference.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"
#include "tests/unit/config_rig.h"

enum { WIDTH = 100, LINE_MOST = 1200 };

static const char *at; /* the next line of what was printed */

/* Takes the next line, without its end. */
static const char *next_line(void)
{
    static char line[LINE_MOST];
    const size_t n = strcspn(at, "\n");
    assert_true(*at != '\0' && n < sizeof line);
    snprintf(line, sizeof line, "%.*s", (int)n, at);
    at += n + 1;
    return line;
}

/* Expects a text in lines that begin with blanks and a mark. A line ends where the next word would not fit. The first
 * line may have WIDTH columns, and later ones have one less. */
static void expect_wrapped(const char *text, int indent, const char *mark)
{
    char start[64];
    size_t n;
    snprintf(start, sizeof start, "%*s%s", indent, "", mark);
    do {
        const char *line = next_line();
        if (strncmp(line, start, strlen(start)) != 0) fail_msg("\"%s\" does not begin with \"%s\"", line, start);
        const char *words = line + strlen(start);
        n = strlen(words);
        if (strncmp(text, words, n) != 0) fail_msg("\"%s\" is not \"%s\"", words, text);
        if (strlen(line) > WIDTH && strchr(words, ' ') != NULL) fail_msg("\"%s\" is too long", line);
        text += n;
        if (*text == ' ' && strlen(line) + 1 + strcspn(text + 1, " ") < WIDTH) fail_msg("\"%s\" is short", line);
        text += *text == ' ';
    } while (*text != '\0');
}

static char *print(void (*what)(FILE *out))
{
    char *text = NULL;
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    what(out);
    fclose(out);
    at = text;
    return text;
}

/* ---- the reference */

static void print_noise(FILE *out)
{
    assert_int_equal(config_print_section("noise", out, &err), SH_OK);
}

static void print_profile(FILE *out)
{
    assert_int_equal(config_print_section("profile", out, &err), SH_OK);
}

static void expect_intro(enum config_keys keys)
{
    const char *intro = config_keys_intro(keys);
    assert_int_equal(strncmp(at, intro, strlen(intro)), 0);
    at += strlen(intro);
    assert_string_equal(next_line(), "");
}

static void expect_keys(enum config_keys keys, const char *section)
{
    struct config_key_text text;
    for (size_t i = 0; config_describe_key(keys, i, &text); i++) {
        if (section != NULL && !cfg_is_in(text.path, section)) continue;
        assert_string_equal(next_line(), text.path);
        expect_wrapped(text.what, 4, "");
        expect_wrapped(text.help, 4, "");
    }
}

static void the_reference_has_both_tables(void **state)
{
    (void)state;
    char *text = print(config_print_reference);
    expect_intro(CONFIG_KEYS);
    expect_keys(CONFIG_KEYS, NULL);
    assert_string_equal(next_line(), "");
    expect_intro(CONFIG_PROFILE_KEYS);
    expect_keys(CONFIG_PROFILE_KEYS, NULL);
    assert_int_equal(*at, '\0');
    free(text);
}

static void a_section_is_a_part_of_it(void **state)
{
    (void)state;
    char *text = print(print_noise);
    expect_keys(CONFIG_KEYS, "noise");
    assert_int_equal(*at, '\0');
    free(text);
    text = print(print_profile);
    expect_intro(CONFIG_PROFILE_KEYS);
    expect_keys(CONFIG_PROFILE_KEYS, NULL);
    assert_int_equal(*at, '\0');
    free(text);
}

/* All sections are in the error, and the profile's keys, which have no section. */
static void an_unknown_section_gets_all(void **state)
{
    (void)state;
    char want[600] = "no section \"nois\", did you mean noise?; allowed ";
    size_t used = strlen(want);
    for (size_t i = 0; i < cfg_config_table.n; i++)
        if (strpbrk(cfg_config_table.keys[i].path, ".[") == NULL)
            used += (size_t)snprintf(want + used, sizeof want - used, "%s, ", cfg_config_table.keys[i].path);
    snprintf(want + used, sizeof want - used, "profile");
    assert_int_equal(config_print_section("nois", stdout, &err), SH_EINPUT);
    assert_string_equal(err.text, want);
    assert_int_equal(config_print_section("xyz\n", stdout, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "no section \"xyz?\"; allowed head, scene, "));
}

/* ---- the example */

static void print_example(FILE *out)
{
    assert_int_equal(config_print_example(out, &err), SH_OK);
}

/* Returns in how many sections and elements a key is. */
static int depth_of(const char *path)
{
    int depth = 0;
    for (const char *p = path; (p = strpbrk(p, ".[")) != NULL; p++)
        depth++;
    return depth;
}

/* Expects the line of a key, with or without a # before it, and returns what comes after `mark`. */
static const char *expect_line(const struct cfg_key *key, const char *mark)
{
    char start[128];
    const char *line = next_line();
    snprintf(start, sizeof start, "%*s%s", 2 * depth_of(key->path), "", mark);
    line += *line == '#';
    if (strncmp(line, start, strlen(start)) != 0) fail_msg("%s: \"%s\" is not \"%s\"", key->path, line, start);
    return line + strlen(start);
}

/* Returns the value of a figure in the profile that the example names. */
static double figure_of(const char *profile, const char *key)
{
    char start[64];
    snprintf(start, sizeof start, "\n%s: { value: ", key);
    const char *line = strstr(profile, start);
    if (line == NULL) fail_msg("the profile has no %s", key);
    return strtod(line + strlen(start), NULL);
}

static void expect_written(const struct cfg_key *key, const char *value, const char *profile)
{
    if (key->def != NULL && key->def[0] == '@') {
        char *end;
        assert_true(strtod(value, &end) == figure_of(profile, key->def + 1) && *end == '\0');
        return;
    }
    const char *want = key->def != NULL && key->def[0] != '\0' ? key->def : key->example;
    if (want == NULL) want = "";
    /* Files that come with the program have their own path. Names that YAML would misread have quotes. */
    const size_t n = strlen(value), n_want = strlen(want);
    const int is_quoted = value[0] == '"' && n == n_want + 2 && strncmp(value + 1, want, n_want) == 0;
    const int is_path = key->type == CFG_PATH && value[0] == '/' && n > n_want && strcmp(value + n - n_want, want) == 0;
    if (strcmp(value, want) != 0 && !is_quoted && !is_path) fail_msg("%s: \"%s\", not \"%s\"", key->path, value, want);
}

static void expect_example_key(const struct cfg_key *key, const struct config_profile *figures, const char *profile)
{
    char allowed[CFG_ALLOWED_MAX], help[LINE_MOST], mark[64];
    const char *dot = strrchr(key->path, '.'), *word = dot != NULL ? dot + 1 : key->path;
    const int is_element = key->path[strlen(key->path) - 1] == ']', indent = 2 * depth_of(key->path);
    const int is_section = key->type == CFG_MAP || key->type == CFG_LIST;
    if (is_element && is_section) {
        assert_string_equal(expect_line(key, "-"), "");
        return;
    }
    snprintf(mark, sizeof mark, is_element ? "- " : is_section ? "%s:" : "%s: ", word);
    if (is_section) {
        if (indent == 0) assert_string_equal(next_line(), "");
        const char *rest = expect_line(key, mark);
        assert_string_equal(key->example != NULL ? rest + 1 : rest, key->example != NULL ? key->example : "");
        expect_wrapped(key->help, indent + 2, "# ");
        return;
    }
    snprintf(help, sizeof help, "%s (%s)", key->help, cfg_allowed(key, figures, allowed));
    expect_wrapped(help, indent, "# ");
    expect_written(key, expect_line(key, mark), profile);
}

static void the_example_is_the_table(void **state)
{
    (void)state;
    static struct config_profile figures;
    char path[128];
    const char *name = cfg_find(&cfg_config_table, "head.profile")->example;
    snprintf(path, sizeof path, "config/heads/%s.yaml", name);
    char *profile = read_source(path);
    assert_int_equal(config_load_profile(name, NULL, &figures, &err), SH_OK);
    char *text = print(print_example);
    for (int i = 0; i < 3; i++)
        assert_int_equal(next_line()[0], '#');
    for (size_t i = 0; i < cfg_config_table.n; i++)
        expect_example_key(&cfg_config_table.keys[i], &figures, profile);
    assert_int_equal(*at, '\0');
    free(text);
    free(profile);
}

/* The keys without a # make the smallest useful configuration: a head, a mesh, a station, a link, and a fault. */
static void few_keys_are_needed(void **state)
{
    (void)state;
    static const char *const needed[] = {"head:",
                                         "  profile: ",
                                         "scene:",
                                         "  meshes:",
                                         "    -",
                                         "      file: ",
                                         "      up: z",
                                         "      scale: 1",
                                         "stations:",
                                         "  -",
                                         "    position_m: [0, 0, 1.7]",
                                         "links:",
                                         "  -",
                                         "    type: tcp",
                                         "faults:",
                                         "  -",
                                         "    kind: drop"};
    char *text = print(print_example);
    size_t n = 0;
    while (*at != '\0') {
        const char *line = next_line(), *word = line + strspn(line, " ");
        if (*word == '#' || *word == '\0') continue;
        assert_true(n < sizeof needed / sizeof needed[0]);
        const size_t len = strlen(needed[n]);
        if (strncmp(line, needed[n], len) != 0 || (needed[n][len - 1] != ' ' && line[len] != '\0'))
            fail_msg("\"%s\" is not \"%s\"", line, needed[n]);
        n++;
    }
    assert_int_equal(n, sizeof needed / sizeof needed[0]);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_reference_has_both_tables), cmocka_unit_test(a_section_is_a_part_of_it),
        cmocka_unit_test(an_unknown_section_gets_all),   cmocka_unit_test(the_example_is_the_table),
        cmocka_unit_test(few_keys_are_needed),
    };
    return cmocka_run_group_tests_name("reference and example", tests, set_up, tear_down);
}
