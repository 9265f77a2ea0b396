/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/options.h"

#include <ctype.h>
#include <fcntl.h>
#include <getopt.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "core/err.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/base/nearest.h"

const char *app_program = "scanhead";

enum { FIRST_VALUE = 256, HELP_COLUMNS = 110 };

int app_usage(const struct app_command *command, const char *fmt, ...)
{
    char text[512];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    sh_keep_line(text); /* a path may have any bytes */
    fprintf(stderr, "%s %s: %s; see %s %s --help\n", app_program, command->name, text, app_program, command->name);
    return APP_USAGE;
}

int app_add_set(struct app_sets *sets, const char *set)
{
    if (sets->n == APP_MAX_SETS) {
        fprintf(stderr, "%s: too many settings; at most %d\n", app_program, APP_MAX_SETS);
        return APP_USAGE;
    }
    sets->set[sets->n++] = set;
    return APP_OK;
}

int app_add_file(struct app_input *in, const struct app_file *file)
{
    if (in->n_files == APP_MAX_FILES) {
        fprintf(stderr, "%s: too many files; at most %d\n", app_program, APP_MAX_FILES);
        return APP_USAGE;
    }
    in->file[in->n_files++] = *file;
    return APP_OK;
}

static int add_key(struct app_sets *sets, const char *key, const char *value)
{
    char *text = sets->text + sets->used;
    const size_t room = sizeof sets->text - sets->used, n = strlen(key) + strlen(value) + 2;
    if (n > room) {
        fprintf(stderr, "%s: %s: the text is too long; all options that set keys share %zu characters\n", app_program,
                key, sizeof sets->text);
        return APP_USAGE;
    }
    sets->used += (size_t)snprintf(text, room, "%s=%s", key, value) + 1;
    return app_add_set(sets, text);
}

/* Reads the whole text as a number within the row's limits. */
static int parse_number(const struct app_command *command, const struct app_option *row, const char *text, double *out)
{
    char *end;
    const int whole = row->kind != APP_NUMBER;
    *out = strtod(text, &end);
    const int is_decimal = strcspn(text, "xX") >= (size_t)(end - text); /* strtod reads 0x10, too */
    if (end != text && is_decimal && *end == '\0' && !isspace((unsigned char)text[0]) && *out >= row->min &&
        *out <= row->max && (!whole || *out == floor(*out)))
        return APP_OK;
    return app_usage(command, "--%s %s: not a %s from %.10g to %.10g", row->name, text,
                     whole ? "whole number" : "number", row->min, row->max);
}

int app_find_word(const char *option, const char *word, const char *const *words, size_t n, struct sh_err *err)
{
    char allowed[160] = "";
    for (size_t i = 0; i < n; i++) {
        if (strcmp(word, words[i]) == 0) return (int)i;
        snprintf(allowed + strlen(allowed), sizeof allowed - strlen(allowed), "%s%s", i > 0 ? ", " : "", words[i]);
    }
    return sh_fail(err, SH_EINPUT, "--%s %s: allowed %s %s", option, word, n == 1 ? "is" : "are", allowed);
}

static int take_choice(const struct app_command *command, const struct app_option *row, const char *text, int *out)
{
    struct sh_err err;
    *out = app_find_word(row->name, text, row->choices, row->n_choices, &err);
    return *out >= 0 ? APP_OK : app_usage(command, "%s", err.text);
}

int app_read_numbers(const char *text, char between, double *out, int n)
{
    for (int i = 0; i < n; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || !isfinite(out[i]) || *end != (i < n - 1 ? between : '\0')) return 0;
        if (strcspn(text, "xX") < (size_t)(end - text)) return 0; /* 0x10 */
        text = end + 1;
    }
    return 1;
}

static int pass(const struct app_option *row, const char *text, struct app_words *words)
{
    char *name = words->name[words->n_names];
    snprintf(name, sizeof words->name[0], "--%s", row->name);
    words->n_names++;
    words->word[words->n++] = name;
    if (text != NULL) words->word[words->n++] = text;
    return APP_OK;
}

void app_pass_options(struct app_option *rows, const struct app_command *other, const char *const *names, size_t at)
{
    int n = 0;
    for (; rows[n].kind != APP_LAST; n++)
        if (rows[n].kind == APP_PASS) return; /* the options are in the table already */
    for (const struct app_option *row = other->options; row->kind != APP_LAST && n < APP_MAX_OPTIONS; row++) {
        const char *const *name = names;
        while (*name != NULL && strcmp(*name, row->name) != 0)
            name++;
        if (*name != NULL)
            rows[n++] = (struct app_option){APP_PASS,
                                            row->name,
                                            row->argument,
                                            .at = at,
                                            .key = row->key,
                                            .choices = row->choices,
                                            .n_choices = row->n_choices,
                                            .help = row->help};
    }
}

/* Where the descriptor is not open, a file that is opened later gets its number. The line for the descriptor would then
 * go into that file. */
static int check_output(const struct app_command *command, const struct app_option *row, int fd)
{
    const int flags = fcntl(fd, F_GETFL);
    if (flags >= 0 && (flags & O_ACCMODE) != O_RDONLY) return APP_OK;
    return app_usage(command, "--%s %d: not open for writing; allowed is a descriptor that is, as with %d>FILE",
                     row->name, fd, fd);
}

static int apply(const struct app_command *command, const struct app_option *row, const char *text,
                 struct app_input *in, void *values)
{
    double number = 0.0;
    void *at = (char *)values + row->at;
    if (row->word != NULL && strcmp(text, row->word) == 0) {
        *(long *)at = APP_WORD;
        return APP_OK;
    }
    switch (row->kind) {
    case APP_FLAG:
        *(int *)at = 1;
        return APP_OK;
    case APP_TEXT:
        *(const char **)at = text;
        return APP_OK;
    case APP_NUMBER:
        return parse_number(command, row, text, at);
    case APP_WHOLE:
    case APP_OUTPUT:
        if (parse_number(command, row, text, &number) != APP_OK) return APP_USAGE;
        if (row->kind == APP_OUTPUT && check_output(command, row, (int)number) != APP_OK) return APP_USAGE;
        *(long *)at = (long)number;
        return APP_OK;
    case APP_KEY:
        return add_key(&in->sets, row->key, text);
    case APP_SET:
        return app_add_set(&in->sets, text);
    case APP_CHOICE:
        return take_choice(command, row, text, at);
    case APP_PASS:
        return pass(row, text, at);
    default:
        return row->apply(values, text);
    }
}

/* ---- help */

void app_arguments(const struct app_command *command, char *buf, size_t len)
{
    size_t n = 0;
    buf[0] = '\0';
    for (int i = 0; i < APP_MAX_OPERANDS && command->operand[i] != NULL && n < len; i++)
        n += (size_t)snprintf(buf + n, len - n, " %s", command->operand[i]);
    if (command->needs != NULL && n < len) n += (size_t)snprintf(buf + n, len - n, " %s", command->needs);
    if (command->options[0].kind != APP_LAST && n < len) snprintf(buf + n, len - n, " [options]");
}

/* Prints the text from the present column, `indent`, on; further lines begin in this column, too. */
static void print_wrapped(const char *text, int indent)
{
    int column = indent;
    while (*text != '\0') {
        const int n = (int)strcspn(text, " ");
        if (column > indent && column + 1 + n > HELP_COLUMNS)
            printf("\n%*s", column = indent, "");
        else if (column > indent)
            column += printf(" ");
        column += printf("%.*s", n, text);
        text += n + (text[n] == ' ');
    }
    putchar('\n');
}

static void print_row(const struct app_option *row, int width)
{
    char letter[] = "-?, ";
    letter[1] = row->letter;
    int n = printf("  %-4s--%s %s", row->letter != '\0' ? letter : "", row->name,
                   row->argument != NULL ? row->argument : "");
    printf("%*s", width - n, "");
    print_wrapped(row->help, width);
}

static void print_help(const struct app_command *command)
{
    const struct app_option help = {APP_LAST, "help", command->part, .letter = 'h',
                                    .help = command->part != NULL ? "this text, or only that part" : "this text"};
    char arguments[128];
    size_t longest = strlen(help.name) + (command->part != NULL ? 1 + strlen(command->part) : 0);
    for (const struct app_option *row = command->options; row->kind != APP_LAST; row++) {
        size_t n = strlen(row->name) + (row->argument != NULL ? 1 + strlen(row->argument) : 0);
        if (n > longest) longest = n;
    }
    app_arguments(command, arguments, sizeof arguments);
    printf("%s %s: %s\n\nusage: %s %s%s\n\n", app_program, command->name, command->summary, app_program, command->name,
           arguments);
    for (const struct app_option *row = command->options; row->kind != APP_LAST; row++)
        print_row(row, (int)longest + 10);
    print_row(&help, (int)longest + 10);
    if (command->notes != NULL) printf("\n%s", command->notes);
    if (command->print_more != NULL) command->print_more(stdout);
}

/* ---- parsing */

/* Makes the table that getopt_long takes. The value of a long option is FIRST_VALUE plus the number of its row. */
static void list_options(const struct app_option *row, struct option longs[APP_MAX_OPTIONS + 2], char *letters)
{
    int n = 0;
    letters += sprintf(letters, "-:h");
    for (; n < APP_MAX_OPTIONS && row[n].kind != APP_LAST; n++) {
        int has = row[n].argument != NULL ? required_argument : no_argument;
        longs[n] = (struct option){row[n].name, has, NULL, FIRST_VALUE + n};
        if (row[n].letter != '\0') letters += sprintf(letters, "%c%s", row[n].letter, has ? ":" : "");
    }
    longs[n] = (struct option){"help", no_argument, NULL, 'h'};
    longs[n + 1] = (struct option){NULL, 0, NULL, 0};
}

int app_is_given(const struct app_input *in, const char *option)
{
    for (int i = 0; in->options[i].kind != APP_LAST; i++)
        if (strcmp(in->options[i].name, option) == 0) return (in->given >> i & 1) != 0;
    return 0;
}

static const struct app_option *find_row(const struct app_option *row, int opt)
{
    if (opt >= FIRST_VALUE) return &row[opt - FIRST_VALUE];
    while (row->kind != APP_LAST && row->letter != opt)
        row++;
    return row;
}

const char *app_nearest(const char *word, const char *const *known, size_t n)
{
    const char *best = NULL;
    size_t best_distance = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t distance = nearest_distance(word, known[i]);
        if (!nearest_is_near(word, known[i]) || (best != NULL && distance >= best_distance)) continue;
        best = known[i];
        best_distance = distance;
    }
    return best;
}

/* Returns the long option that a word without its dashes may have meant. The word ends at '='. */
static const char *nearest_option(const struct app_command *command, const char *word)
{
    const char *known[APP_MAX_OPTIONS + 1] = {"help"};
    char name[NEAREST_MAX];
    size_t n = 1;
    for (const struct app_option *row = command->options; row->kind != APP_LAST && n <= APP_MAX_OPTIONS; row++)
        known[n++] = row->name;
    snprintf(name, sizeof name, "%.*s", (int)strcspn(word, "="), word);
    return app_nearest(name, known, n);
}

static int fail_unknown(const struct app_command *command, const char *word)
{
    const char *meant = nearest_option(command, word + strspn(word, "-"));
    if (meant == NULL) return app_usage(command, "unknown option %s", word);
    return app_usage(command, "unknown option %s, did you mean --%s?", word, meant);
}

/* "-out x.ply": a long option with one dash, which getopt takes for letters: -o with the value "ut". */
static int check_dash(const struct app_command *command, const char *word)
{
    const struct app_option *row = command->options;
    const size_t len = strcspn(word + 1, "=");
    if (word[0] != '-' || word[1] == '-' || len < 3) return APP_OK;
    while (row->kind != APP_LAST && strncmp(row->name, word + 1, len) != 0)
        row++;
    if (row->kind == APP_LAST) return APP_OK;
    if (row->letter == word[1] && row->argument != NULL)
        return app_usage(command, "%s: did you mean --%s %s, or -%c %s?", word, row->name, row->argument, row->letter,
                         row->argument);
    return app_usage(command, "%s: did you mean --%s?", word, row->name);
}

/* ---- operands */

/* Files that are no configuration, by their ending, and what takes them: scanhead VERB FILE REST. NULL: no command. */
static const struct {
    const char *endings, *what, *verb, *rest;
} others[] = {
    {".shs.pcapng", "a recorded stream", "record", " -o points.ply writes its points"},
    {".obj.stl.gltf.glb.fbx.dae.ifc.tif.tiff", "a mesh", "init", " writes a configuration that scans it"},
    {".ply", "a mesh or a point cloud", "init", " writes a configuration that scans a mesh"},
    {".las", "a recording", "report CONFIG", " compares points with the scene"},
    {".laz.e57.ptx", "a recording for other programs", NULL, NULL},
};

static int check_ending(const struct app_command *command, const char *label, const char *file)
{
    const char *dot = strrchr(file, '.');
    char ending[16] = "";
    const int is_source = strcmp(label, "SOURCE") == 0, takes_streams = is_source || strstr(label, ".shs") != NULL;
    const int takes_clouds = strcmp(label, "CONFIG|CLOUD") == 0;
    if (!takes_streams && !takes_clouds && strcmp(label, "CONFIG") != 0) return APP_OK;
    for (size_t i = 0; dot != NULL && dot[i] != '\0' && i < sizeof ending - 1; i++)
        ending[i] = (char)tolower((unsigned char)dot[i]);
    for (size_t i = takes_streams ? 1 : 0; i < sizeof others / sizeof others[0] && strlen(ending) > 1; i++) {
        const char *at = strstr(others[i].endings, ending);
        const char after = at != NULL ? at[strlen(ending)] : 'x';
        if (after != '.' && after != '\0') continue;
        if (takes_clouds && strstr(".ply.las", ending) != NULL) return APP_OK;
        const char *wanted = is_source      ? "SOURCE is a head, a recorded stream or a configuration"
                             : takes_clouds ? "a CONFIG, FILE.ply or FILE.las is needed"
                                            : "CONFIG is a configuration, a YAML file";
        if (others[i].verb == NULL) return app_usage(command, "%s is %s, and %s", file, others[i].what, wanted);
        return app_usage(command, "%s is %s, and %s: scanhead %s %s%s", file, others[i].what, wanted, others[i].verb,
                         file, others[i].rest);
    }
    return APP_OK;
}

static int too_many(const struct app_command *command, int needed, int n, char *const *words)
{
    if (needed == 0) return app_usage(command, "%s: it takes no arguments", words[0]);
    if (needed == 1)
        return app_usage(command, "one %s is needed, and %d are given: %s, %s%s", command->operand[0], n, words[0],
                         words[1], n > 2 ? ", ..." : "");
    return app_usage(command, "one %s and one %s are needed; %s is one too many", command->operand[0],
                     command->operand[1], words[needed]);
}

static int take_operands(const struct app_command *command, int n, char *const *words, struct app_input *in)
{
    int needed = 0;
    if (in->alone && n > 0)
        return app_usage(command, "%s: with these options it takes no %s", words[0], command->operand[0]);
    if (in->alone) return APP_GO_ON;
    while (needed < APP_MAX_OPERANDS && command->operand[needed] != NULL)
        needed++;
    if (n > needed) return too_many(command, needed, n, words);
    if (n < needed && needed == 1) return app_usage(command, "one %s is needed", command->operand[0]);
    if (n < needed) return app_usage(command, "one %s and one %s are needed", command->operand[0], command->operand[1]);
    for (int i = 0; i < n; i++) {
        if (check_ending(command, command->operand[i], words[i]) != APP_OK) return APP_USAGE;
        in->operand[i] = words[i];
        if (app_add_file(in, &(struct app_file){.path = words[i], .use = APP_READS}) != APP_OK) return APP_USAGE;
    }
    return APP_GO_ON;
}

static void (*help_printer)(const struct app_command *command) = print_help;

void app_set_help(void (*print)(const struct app_command *command))
{
    help_printer = print != NULL ? print : print_help;
}

/* ---- the command line as a whole */

/* Counts all operands, and keeps only as many as an error message shows. */
static void count_operand(char *words[APP_MAX_OPERANDS + 1], int *n, char *word)
{
    if (*n <= APP_MAX_OPERANDS) words[*n] = word;
    ++*n;
}

/* Takes the option that getopt has found in `word`. Returns APP_OK, or the exit status of an error. *done: what follows
 * on the command line is not read. */
static int take_option(const struct app_command *command, int opt, const char *word, struct app_input *in, void *values,
                       int *done)
{
    const struct app_option *row = find_row(command->options, opt);
    if (check_dash(command, word) != APP_OK) return APP_USAGE;
    if (opt == ':') return app_usage(command, "option %s needs a value", word);
    if (opt == '?' && optopt >= FIRST_VALUE) return app_usage(command, "%s: the option takes no value", word);
    if (opt == '?') return fail_unknown(command, word);
    *done = row->kind == APP_PRINT;
    in->alone |= row->kind == APP_ALONE;
    in->n_options++;
    const uint64_t bit = UINT64_C(1) << (row - command->options);
    if ((row->kind == APP_TEXT || row->kind == APP_CHOICE || row->kind == APP_PASS) && (in->given & bit) != 0)
        return app_usage(command, "--%s: given twice; one is allowed", row->name);
    in->given |= bit;
    const struct app_file file = {.option = row->name, .path = optarg, .use = row->file, .is_given = 1};
    if (row->file != APP_NO_FILE && app_add_file(in, &file) != APP_OK) return APP_USAGE;
    return apply(command, row, optarg, in, values);
}

static int help(const struct app_command *command, const char *part)
{
    if (part != NULL && command->print_part != NULL) return command->print_part(part);
    help_printer(command);
    return APP_OK;
}

/* Operands may stand among the options: getopt gives each as option 1. */
int app_parse(const struct app_command *command, int argc, char **argv, struct app_input *in, void *values)
{
    struct option longs[APP_MAX_OPTIONS + 2];
    char letters[2 * APP_MAX_OPTIONS + 4], *words[APP_MAX_OPERANDS + 1];
    int opt, n = 0, done = 0;
    memset(in, 0, sizeof *in);
    in->options = command->options;
    in->opens_links = command->opens_links;
    list_options(command->options, longs, letters);
    opterr = 0;
    optind = 0; /* from the beginning, whatever was parsed before */
    for (int at = 1; (opt = getopt_long(argc, argv, letters, longs, NULL)) != -1; at = optind) {
        if (opt == 1) {
            count_operand(words, &n, optarg);
            continue;
        }
        if (opt == 'h') return help(command, argc > optind && argv[optind][0] != '-' ? argv[optind] : NULL);
        const int status = take_option(command, opt, argv[at], in, values, &done);
        if (status != APP_OK || done) return status;
    }
    for (; optind < argc; optind++)
        count_operand(words, &n, argv[optind]); /* after -- */
    app_set_quiet(app_is_given(in, "quiet"));
    return take_operands(command, n, words, in);
}
