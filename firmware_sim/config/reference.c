/* SPDX-License-Identifier: MIT */
/* Prints all keys of the tables: as a reference, and as a configuration to begin with. */
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/shared.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/base/nearest.h"
#include "firmware_sim/config/reference.h"

/* config_print_section prints the keys of head profiles for this name. */
static const char PROFILE[] = "profile";

static const char *type_name(const struct cfg_key *key)
{
    static const char *const names[] = {
        [CFG_MAP] = "section",        [CFG_LIST] = "list",          [CFG_BOOL] = "switch",
        [CFG_ENUM] = "word",          [CFG_COUNT] = "whole number", [CFG_MICRO] = "number, exact to 1e-6",
        [CFG_REAL] = "number",        [CFG_TEXT] = "text",          [CFG_PATH] = "path",
        [CFG_VEC3] = "three numbers", [CFG_PAIR] = "two numbers",   [CFG_POINTS] = "list of points"};
    return names[key->type];
}

/* Prints a text within 100 columns; each line begins with `indent` blanks and `mark`. */
static void print_wrapped(const char *text, int indent, const char *mark, FILE *out)
{
    enum { WIDTH = 100 };
    int column = 0;
    while (*text != '\0') {
        int n = (int)strcspn(text, " ");
        if (column != 0 && column + 1 + n <= WIDTH)
            column += fprintf(out, " %.*s", n, text);
        else
            column = fprintf(out, "%s%*s%s%.*s", column != 0 ? "\n" : "", indent, "", mark, n, text);
        text += n + (text[n] == ' ');
    }
    fputc('\n', out);
}

/* Adds whether the key may be left out, and its default. */
static void add_default(const struct cfg_key *key, char *line, size_t room)
{
    char emitters[64];
    if (key->def == NULL && (key->type != CFG_LIST || key->min > 0))
        snprintf(line, room, "; required");
    else if (key->def != NULL && key->def[0] == '@')
        snprintf(line, room, "; default from the head profile, its %s", key->def + 1);
    else if (key->def != NULL && key->def[0] != '\0')
        snprintf(line, room, "; default %s", key->def);
    else if (cfg_needed_by_emitter(key, emitters, sizeof emitters))
        snprintf(line, room, "; required with emitter: %s", emitters);
    else
        snprintf(line, room, "; optional");
}

static void reference_describe(const struct cfg_key *key, struct config_key_text *out)
{
    static const char *const switches[] = {"off", "on", NULL};
    char allowed[CFG_ALLOWED_MAX];
    *out = (struct config_key_text){key->path, key->help, key->type == CFG_BOOL ? switches : key->names,
                                    .has_value = key->type != CFG_MAP && key->type != CFG_LIST};
    int len = snprintf(out->what, sizeof out->what, "%s", type_name(key));
    if (key->type == CFG_MAP) return;
    len += snprintf(out->what + len, sizeof out->what - (size_t)len, "%s%s; %s", key->unit != NULL ? ", " : "",
                    key->unit != NULL ? key->unit : "", cfg_allowed(key, NULL, allowed));
    add_default(key, out->what + len, sizeof out->what - (size_t)len);
}

int config_describe_key(enum config_keys keys, size_t i, struct config_key_text *out)
{
    const struct cfg_table *table = keys == CONFIG_KEYS ? &cfg_config_table : &cfg_profile_table;
    if (i >= table->n) return 0;
    reference_describe(&table->keys[i], out);
    return 1;
}

static void print_key(const struct cfg_key *key, FILE *out)
{
    struct config_key_text text;
    reference_describe(key, &text);
    fprintf(out, "%s\n", text.path);
    print_wrapped(text.what, 4, "", out);
    print_wrapped(text.help, 4, "", out);
}

static void print_keys(const struct cfg_table *table, FILE *out)
{
    for (size_t i = 0; i < table->n; i++)
        print_key(&table->keys[i], out);
}

const char *config_keys_intro(enum config_keys keys)
{
    if (keys == CONFIG_KEYS)
        return "Configuration, YAML. Any key can be set with --set KEY=VALUE (elements as in stations[0].name=gate; the\n"
               "index after the last one appends). Numbers are decimal, as in 300000, 0.5 or 1.2e6, without a unit.\n"
               "Relative paths start at the file they stand in; in --set, at the working directory.\n";
    return "Head profile, heads/NAME.yaml. maker and model are texts; each figure is written { value: V, from: GRADE "
           "}.\n"
           "GRADE is data sheet (it is in a named source, or two sources agree), quoted (a source gives it without "
           "naming\n"
           "its own), or assumed. source: TEXT and note: TEXT may follow, for readers of the file.\n";
}

static void print_profile_keys(FILE *out)
{
    fprintf(out, "%s\n", config_keys_intro(CONFIG_PROFILE_KEYS));
    print_keys(&cfg_profile_table, out);
}

void config_print_reference(FILE *out)
{
    fprintf(out, "%s\n", config_keys_intro(CONFIG_KEYS));
    print_keys(&cfg_config_table, out);
    fputc('\n', out);
    print_profile_keys(out);
}

static int fail_section(const char *section, struct sh_err *err)
{
    char known[300] = "", shown[CFG_SHOW_MAX];
    const char *near = NULL;
    for (size_t i = 0; i < cfg_config_table.n; i++) {
        const char *path = cfg_config_table.keys[i].path;
        if (cfg_word_below(path, "") == NULL) continue;
        cfg_list_add(known, sizeof known, path);
        if (near == NULL && nearest_is_near(section, path)) near = path;
    }
    return sh_fail(err, SH_EINPUT, "no section \"%s\"%s%s%s; allowed %s, %s", cfg_show(section, shown),
                   near != NULL ? ", did you mean " : "", near != NULL ? near : "", near != NULL ? "?" : "", known,
                   PROFILE);
}

int config_print_section(const char *section, FILE *out, struct sh_err *err)
{
    int n = 0;
    if (strcmp(section, PROFILE) == 0) {
        print_profile_keys(out);
        return SH_OK;
    }
    for (size_t i = 0; i < cfg_config_table.n; i++) {
        if (!cfg_is_in(cfg_config_table.keys[i].path, section)) continue;
        print_key(&cfg_config_table.keys[i], out);
        n++;
    }
    return n > 0 ? SH_OK : fail_section(section, err);
}

/* ---- the example */

/* Returns whether a configuration needs the key. The example comments the others out. */
static int is_needed(const struct cfg_key *key)
{
    const int has_value = key->type != CFG_MAP && key->type != CFG_LIST;
    return has_value && (key->def == NULL || (key->flags & CFG_NEEDED));
}

static int has_needed(const char *section)
{
    for (size_t i = 0; i < cfg_config_table.n; i++)
        if (cfg_is_in(cfg_config_table.keys[i].path, section) && is_needed(&cfg_config_table.keys[i])) return 1;
    return 0;
}

/* Returns whether the key is a list that only some heads have, or a key in such a list. */
static int is_special(const char *path)
{
    for (size_t i = 0; i < cfg_config_table.n; i++) {
        const struct cfg_key *key = &cfg_config_table.keys[i];
        if ((key->flags & CFG_SPECIAL) != 0 && cfg_is_in(path, key->path)) return 1;
    }
    return 0;
}

/* Returns the indent of a key's line: sections and elements of lists each add two blanks. */
static int indent_of(const char *path)
{
    int n = 0;
    for (; *path != '\0'; path++)
        n += *path == '.' || *path == '[';
    return 2 * n;
}

/* Returns the value in the example: the default, the profile's value, or a typical value. */
static const char *value_of(const struct cfg_key *key, const struct config_profile *profile, char *buf, size_t len)
{
    const char *text = key->def != NULL && key->def[0] != '\0' ? key->def : key->example;
    char shared[CONFIG_PATH_LEN], *whole = NULL;
    if (text == NULL) return "";
    snprintf(buf, len, "%s", text);
    if (text[0] == '@') {
        if (key->type == CFG_REAL)
            snprintf(buf, len, "%.15g", cfg_real_figure(profile, text + 1));
        else
            snprintf(buf, len, "%.15g", from_micro(cfg_figure(profile, text + 1)));
    } else if (key->type == CFG_PATH && is_needed(key) && cfg_find_shared(text, shared) &&
               (whole = realpath(shared, NULL)) != NULL) {
        snprintf(buf, len, "%s", whole);
    } else if ((key->type == CFG_TEXT || key->type == CFG_PATH) && strpbrk(text, "*#:?{}[],&!|>'%@`") == text) {
        snprintf(buf, len, "\"%s\"", text);
    }
    free(whole);
    return buf;
}

static void print_example_key(const struct cfg_key *key, const struct config_profile *profile, FILE *out)
{
    char value[CONFIG_PATH_LEN + 2], allowed[CFG_ALLOWED_MAX], help[1024 + CFG_ALLOWED_MAX];
    const int indent = indent_of(key->path), is_section = key->type == CFG_MAP || key->type == CFG_LIST;
    const char *dot = strrchr(key->path, '.'), *word = dot != NULL ? dot + 1 : key->path;
    const int is_element = strcmp(word + strlen(word) - 2, "[]") == 0;
    const int is_shown = (is_section ? has_needed(key->path) : is_needed(key)) && !is_special(key->path);
    const char *hidden = is_shown ? "" : "#";
    if (is_element && is_section) {
        fprintf(out, "%s%*s-\n", hidden, indent, "");
        return;
    }
    if (is_section) {
        fprintf(out, "%s%s%*s%s:%s%s\n", indent == 0 ? "\n" : "", hidden, indent, "", word,
                key->example != NULL ? " " : "", key->example != NULL ? key->example : "");
        print_wrapped(key->help, indent + 2, "# ", out);
        return;
    }
    snprintf(help, sizeof help, "%s (%s)", key->help, cfg_allowed(key, profile, allowed));
    print_wrapped(help, indent, "# ", out);
    if (is_element)
        fprintf(out, "%s%*s- %s\n", hidden, indent, "", value_of(key, profile, value, sizeof value));
    else
        fprintf(out, "%s%*s%s: %s\n", hidden, indent, "", word, value_of(key, profile, value, sizeof value));
}

int config_print_example(FILE *out, struct sh_err *err)
{
    struct config_profile profile;
    int code = config_load_profile(cfg_find(&cfg_config_table, "head.profile")->example, NULL, &profile, err);
    if (code != SH_OK) return code;
    fputs("# All keys of a configuration. Lines without a # are needed. Each other key stands with its default, or\n"
          "# with a value that shows its form. To change one, take the # away from the first column, also from the\n"
          "# sections around it. Not all of them go together: `scanhead check` says which do.\n",
          out);
    for (size_t i = 0; i < cfg_config_table.n; i++)
        print_example_key(&cfg_config_table.keys[i], &profile, out);
    return SH_OK;
}
