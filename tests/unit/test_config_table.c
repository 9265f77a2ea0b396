/* The configuration table itself: its reference, and the soundness of its rows. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/config/table.h"

static void the_reference_names_every_key(void **state)
{
    (void)state;
    char *text = NULL, line[CFG_PATH_MAX + 2];
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    config_print_reference(out);
    fclose(out);
    char *joined = strdup(text); /* help texts are wrapped */
    for (char *at = joined; (at = strstr(at, "\n    ")) != NULL;)
    {
        memmove(at + 1, at + 5, strlen(at + 5) + 1);
        *at = ' ';
    }
    const struct cfg_table *tables[] = {&cfg_config_table, &cfg_profile_table};
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            const struct cfg_key *key = &tables[t]->keys[i];
            snprintf(line, sizeof line, "\n%s\n", key->path);
            if (strstr(text, line) == NULL || strstr(joined, key->help) == NULL)
                fail_msg("%s is not there", key->path);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_reference_names_every_key),
        cmocka_unit_test(rows_are_sound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
