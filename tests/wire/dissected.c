/* SPDX-License-Identifier: MIT */
#include "tests/wire/dissected.h"

#include <limits.h>

enum { COLUMNS_MAX = 200 };
static struct column {
    const char *name;
    char **value;
    size_t n, room, taken;
} column[COLUMNS_MAX];
static int n_columns;
static char *text;

static struct column *find(const char *field)
{
    for (int i = 0; i < n_columns; i++)
        if (strcmp(column[i].name, field) == 0) return &column[i];
    fail_msg("%s was not asked of tshark", field);
    return NULL;
}

static void add_value(struct column *c, char *value)
{
    if (c->n == c->room) {
        c->room = 2 * c->room + 64;
        c->value = realloc(c->value, c->room * sizeof *c->value);
        assert_non_null(c->value);
    }
    c->value[c->n++] = value;
}

/* Each line is a packet, and each column a field. Several values of one packet have `|` between them. */
static void split(char *all)
{
    for (char *line; (line = strsep(&all, "\n")) != NULL && *line != 0;)
        for (int i = 0; i < n_columns; i++) {
            char *cell = strsep(&line, "\t");
            assert_non_null(cell);
            while (cell != NULL && *cell != 0)
                add_value(&column[i], strsep(&cell, "|"));
        }
}

static void forget(void)
{
    for (int i = 0; i < n_columns; i++)
        free(column[i].value);
    memset(column, 0, sizeof column);
    n_columns = 0;
    free(text);
}

/* From 4.4 on Wireshark runs no script for root. */
static void skip_without_scripts(void)
{
    int major = 0, minor = 0;
    FILE *says = geteuid() == 0 ? popen("tshark -v 2>/dev/null", "r") : NULL;
    if (says == NULL) return;
    const int n = fscanf(says, "TShark (Wireshark) %d.%d", &major, &minor);
    pclose(says);
    if (n != 2 || major < 4 || (major == 4 && minor < 4)) return;
    print_message("# tshark %d.%d runs no Lua for root: run this as another user\n", major, minor);
    skip();
}

void dissect(const char *file, int passes, const char *const *fields)
{
    skip_without_scripts();
    static char *copy;
    const char *argv[2 * COLUMNS_MAX + 20] = {"tshark", "-n", "-r", file, "-T", "fields", "-E", "aggregator=|"};
    char script[PATH_MAX + 16] = "lua_script:";
    size_t n = 8;
    forget();
    assert_non_null(realpath("drivers/protocol/wireshark/scanhead.lua", script + 11));
    argv[n++] = "-X";
    argv[n++] = script;
    if (passes == 2) argv[n++] = "-2";
    for (; *fields != NULL; fields++) {
        assert_true(n_columns < COLUMNS_MAX);
        column[n_columns++].name = *fields;
        argv[n++] = "-e";
        argv[n++] = *fields;
    }
    /* This makes other copies of the script, and the user's preferences of ports, have no effect. */
    setenv("HOME", wire->dir, 1);
    setenv("WIRESHARK_CONFIG_DIR", wire->dir, 1);
    run_well(argv);
    text = wire_read(wire_path(wire, "tool.out"), NULL);
    char *said = wire_read(wire_path(wire, "tool.err"), NULL);
    if (strstr(said, "Lua") != NULL) fail_msg("%s", said);
    free(said);
    free(copy);
    copy = strdup(text);
    split(copy);
}

const char *dissected_text(void)
{
    return text;
}

size_t dissected_count(const char *field)
{
    return find(field)->n;
}

size_t dissected_left(const char *field)
{
    const struct column *c = find(field);
    return c->n - c->taken;
}

const char *take_text(const char *field)
{
    struct column *c = find(field);
    if (c->taken == c->n) fail_msg("%s: only %zu values", field, c->n);
    return c->value[c->taken++];
}

void expect_text(const char *field, const char *value)
{
    const char *found = take_text(field);
    if (strcmp(found, value) != 0) fail_msg("%s: %s, and not %s", field, found, value);
}

void expect_uint(const char *field, uint64_t value)
{
    const char *found = take_text(field);
    if (strcmp(found, "True") == 0) found = "1"; /* as later versions write them */
    if (strcmp(found, "False") == 0) found = "0";
    if (strtoull(found, NULL, 0) != value) fail_msg("%s: %s, and not %llu", field, found, (unsigned long long)value);
}

void expect_int(const char *field, int64_t value)
{
    const char *found = take_text(field);
    if (strtoll(found, NULL, 0) != value) fail_msg("%s: %s, and not %lld", field, found, (long long)value);
}

void expect_ns(const char *field, int64_t ns)
{
    const char *found = take_text(field);
    long long s, rest;
    int digits, minus = *found == '-';
    if (sscanf(found + minus, "%lld.%lld%n", &s, &rest, &digits) != 2 || s * 1000000000 + rest != (minus ? -ns : ns))
        fail_msg("%s: %s s, and not %lld ns", field, found, (long long)ns);
}

void expect_real(const char *field, double value, double error)
{
    const char *found = take_text(field);
    if (!(fabs(strtod(found, NULL) - value) <= 5e-15 * fabs(value) + error))
        fail_msg("%s: %s, and not %.17g", field, found, value);
}

void expect_no_more(void)
{
    for (int i = 0; i < n_columns; i++)
        if (column[i].taken != column[i].n)
            fail_msg("%s: %zu values, and %zu were expected", column[i].name, column[i].n, column[i].taken);
}
