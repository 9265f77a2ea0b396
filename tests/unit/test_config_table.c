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

static void the_example_loads(void **state)
{
    (void)state;
    char *text = print_example();
    assert_loads(load_text(text));
    free(text);
}

/* "# word" is a comment. A key after a # has no blank there, or two and more. */
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
    memset(&faults, 0, sizeof faults);
    memset(cfg, 0, sizeof *cfg);
    cfg_reader_init(&rd, config_path, &cfg_config_table, cfg, &faults);
    assert_int_equal(cfg_read_file(&rd), SH_OK);
    if (faults.n != 0) fail_msg("%s", faults.fault[0].text);
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
    assert_int_equal(config_print_section("", stdout, &err), SH_EINPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_reference_names_every_key),
        cmocka_unit_test(rows_are_sound),
        cmocka_unit_test(the_example_loads),
        cmocka_unit_test(the_example_has_every_key),
        cmocka_unit_test(a_section_has_its_keys),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
