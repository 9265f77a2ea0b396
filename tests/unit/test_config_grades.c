/* SPDX-License-Identifier: MIT */
/* The list of head profiles says how sure each figure is. For every profile that comes with the program this is
 * compared with what its file says, read here line by line. */
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/reference.h"
#include "firmware_sim/config/table/row.h"
#include "tests/unit/config_rig.h"

#include <glob.h>

enum { GRADES = 3 };
static const char *const grades[GRADES] = {"data sheet", "quoted", "assumed"};

static unsigned char found[CFG_MAX_ROWS][GRADES]; /* by the row of the profile's table */

static void note_grade(const char *path, const char *from)
{
    const struct cfg_key *key = cfg_find(&cfg_profile_table, path);
    if (key == NULL) fail_msg("no key %s", path);
    for (int g = 0; g < GRADES; g++)
        if (strncmp(from, grades[g], strlen(grades[g])) == 0) found[key - cfg_profile_table.keys][g] = 1;
}

/* Notes the grades of a file. Each figure of `programs` has a path of its own. For any other list, the grades of all
 * its elements are noted together. */
static void read_grades(char *text)
{
    char section[CFG_PATH_MAX] = "", path[CFG_PATH_MAX] = "", word[64];
    memset(found, 0, sizeof found);
    for (char *line = strtok(text, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        const char *at = line + strspn(line, " -");
        if (*at == '#') continue;
        if (sscanf(at, "%63[a-z0-9_]:", word) == 1 && at[strlen(word)] == ':') {
            if (at == line) snprintf(section, sizeof section, "%s", word);
            if (strcmp(section, "programs") == 0 && at != line)
                snprintf(path, sizeof path, "programs[].%s", word);
            else
                snprintf(path, sizeof path, "%s", section);
        }
        const char *from = strstr(line, "from: ");
        if (from != NULL) note_grade(path, from + strlen("from: "));
    }
}

/* Takes a line of words, "  quoted     3: firing_ns, beams,", and its continuation below, as "3: firing_ns, beams". */
static void take_words(const char **at, char *words, size_t room)
{
    size_t used = 0;
    do {
        const size_t blanks = strspn(*at, " "), n = strcspn(*at + blanks, "\n");
        used += (size_t)snprintf(words + used, room - used, "%s%.*s", used > 0 ? " " : "", (int)n, *at + blanks);
        *at += blanks + n + 1;
    } while (strncmp(*at, "             ", 12) == 0);
}

/* Compares the grades at the end of a profile's part of the list. */
static void expect_grades(const char *list, const char *name)
{
    char start[64], want[1600], got[1600];
    snprintf(start, sizeof start, "%s: ", name);
    const char *at = strstr(list, start);
    while (at != NULL && at > list && at[-1] != '\n')
        at = strstr(at + 1, start);
    assert_non_null(at);
    for (at = strstr(at, "\n  pulse rate, kHz") + 1; strncmp(at, "  pulse", 7) == 0 || (at[2] >= '0' && at[2] <= '9');)
        at = strchr(at, '\n') + 1;
    for (int g = 0; g < GRADES; g++) {
        int n = 0;
        size_t used = 0;
        want[0] = '\0';
        for (size_t row = 0; row < cfg_profile_table.n; row++)
            n += found[row][g];
        if (n == 0) continue;
        used += (size_t)snprintf(want, sizeof want, "%-10s %d:", grades[g], n);
        for (size_t row = 0; row < cfg_profile_table.n; row++)
            if (found[row][g])
                used += (size_t)snprintf(want + used, sizeof want - used, " %s%s", cfg_profile_table.keys[row].path,
                                         --n > 0 ? "," : "");
        take_words(&at, got, sizeof got);
        if (strcmp(got, want) != 0) fail_msg("%s: \"%s\", expected \"%s\"", name, got, want);
    }
    assert_true(*at == '\0' || *at != ' '); /* the next profile */
}

static void the_list_has_the_grades_of_the_files(void **state)
{
    (void)state;
    char *list = NULL;
    size_t len = 0;
    glob_t files;
    FILE *out = open_memstream(&list, &len);
    assert_int_equal(glob("config/heads/*.yaml", 0, NULL, &files), 0);
    assert_int_equal(config_list_profiles("config/heads", out, &err), files.gl_pathc);
    fclose(out);
    for (size_t i = 0; i < files.gl_pathc; i++) {
        char name[64], *text = read_source(files.gl_pathv[i]);
        const char *base_name = strrchr(files.gl_pathv[i], '/') + 1;
        snprintf(name, sizeof name, "%.*s", (int)(strlen(base_name) - strlen(".yaml")), base_name);
        read_grades(text);
        free(text);
        expect_grades(list, name);
    }
    globfree(&files);
    free(list);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_list_has_the_grades_of_the_files)};
    return cmocka_run_group_tests_name("grades of profiles", tests, NULL, NULL);
}
