/* SPDX-License-Identifier: MIT */
/* Where node is looked for: in the folders of PATH, as execvp does. */
#include <sys/stat.h>

#include "core/import/ifc/ifc_read.h"
#include "tests/unit/scene_files.h"

/* An empty folder has no readers, so that only node decides what is said. */
static const char *reason(const char *search)
{
    static char why[256];
    struct scene_import_limits limits = scene_import_defaults;
    char empty[] = "/nonexistent";
    limits.ifc_folder = empty;
    if (search != NULL)
        setenv("PATH", search, 1);
    else
        unsetenv("PATH");
    assert_false(ifc_readers_are_there(&limits, why, sizeof why));
    return why;
}

static void node_is_found_in_any_folder(void **state)
{
    (void)state;
    static const char missing[] = "node is not installed";
    static const char found[] = "the readers of IFC are not installed (`make deps-build` installs them; an installed "
                                "program looks in ../share/scanhead/ifc)";
    static const char *const with[] = {"%s", "/nonexistent:%s", "/nonexistent:/none:%s:/none", "%s:/nonexistent", ":%s",
                                       "%s:"};
    char search[256];
    write_text("node", "");
    char *was = strdup(getenv("PATH"));
    snprintf(search, sizeof search, "/nonexistent:%s", folder);
    assert_string_equal(reason(search), missing); /* no program */
    assert_int_equal(chmod(path_in("node"), 0700), 0);
    for (size_t i = 0; i < sizeof with / sizeof with[0]; i++) {
        const char *at = strstr(with[i], "%s");
        snprintf(search, sizeof search, "%.*s%s%s", (int)(at - with[i]), with[i], folder, at + 2);
        if (strcmp(reason(search), found) != 0) fail_msg("%s: %s", search, reason(search));
    }
    static const char *const without[] = {"", "/nonexistent", "/nonexistent:/none", ":", NULL};
    for (size_t i = 0; i < sizeof without / sizeof without[0]; i++)
        assert_string_equal(reason(without[i]), missing);
    snprintf(search, sizeof search, "/nonexistent%s:/nonexistent%s", folder, folder); /* that folder is below another */
    assert_string_equal(reason(search), missing);
    setenv("PATH", was, 1);
    free(was);
    unlink(path_in("node"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(node_is_found_in_any_folder)};
    return cmocka_run_group_tests_name("ifc_node", tests, make_folder, remove_folder);
}
