/* SPDX-License-Identifier: MIT */
/* `scanhead help` with two made-up commands: the list of commands, the help of one, manual pages as roff (the escapes
 * are those of groff_char(7), the macros those of man(7)), and the completion. */
#include "firmware_sim/app/help/help.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/reference.h"
#include "tests/unit/output_rig.h"

struct values {
    const char *text;
    int flag;
};

static int take(void *values, const char *text)
{
    (void)values, (void)text;
    return APP_OK;
}

#define X42 "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
#define X43 X42 "x"
static const char *const levels[] = {"low", "high"};

/* clang-format off */
static const struct app_option ALPHA[] = {
    {APP_TEXT, "output", "FILE", .letter = 'o', .at = offsetof(struct values, text), .file = APP_WRITES,
     .help = "a file's name"},
    {APP_KEY, "pace", "PACE", .key = "loop.pace", .help = ".pace"},
    {APP_KEY, "threads", "N", .key = "loop.threads", .help = "a key without words"},
    {APP_TEXT, "size", "N|all|7", .at = offsetof(struct values, text), .help = X42 " " X43 " " X43 " " X43},
    {APP_TEXT, "level", "WORD", .at = offsetof(struct values, text), OPTION_CHOICES(levels), .help = "l"},
    {APP_CALL, "folder", "DIR", .apply = take, .help = "f"},
    {APP_CALL, "from", "DIRECTION", .apply = take, .help = "d"},
    {APP_SET, "set", "KEY=VALUE", .help = "s"},
    {APP_CALL, "config", "CONFIG", .apply = take, .help = "c"},
    {APP_FLAG, "quiet", NULL, .at = offsetof(struct values, flag), .help = "q"},
    OPTION_END
};
static const struct app_option RECORD[] = {OPTION_END};
static const struct app_option RAW[] = {{APP_FLAG, "raw", NULL, .at = offsetof(struct values, flag), .help = "r"},
                                        OPTION_END};
/* clang-format on */

static struct app_input in;
static struct values values;

static void print_more(FILE *out)
{
    fputs("more\n", out);
}

static int print_part(const char *part)
{
    return printf("part %s\n", part), APP_OK;
}

static int alpha_run(int argc, char **argv);
static const struct app_command alpha = {
    .name = "alpha",
    .operand = {"CONFIG", "CLOUD"},
    .needs = "-o FILE",
    .summary = "what `it` does",
    .options = ALPHA,
    .notes = "A paragraph\nof two lines.\n\n  indented\nnot\n\n.dot \\ ^ ~\n\na  column\n",
    .print_more = print_more,
    .part = "[SECTION]",
    .print_part = print_part,
    .run = alpha_run,
};

static int alpha_run(int argc, char **argv)
{
    return app_parse(&alpha, argc, argv, &in, &values);
}

static const struct app_command raw = {.name = "record", .summary = "raw data", .options = RAW};
static int record_run(int argc, char **argv);
static const struct app_command record = {.name = "record", .summary = "points", .options = RECORD, .run = record_run};

static int record_run(int argc, char **argv)
{
    const int is_raw = argc > 1 && strcmp(argv[1], "--raw") == 0;
    return app_parse(is_raw ? &raw : &record, argc, argv, &in, &values);
}

static const struct app_command *const COMMANDS[] = {&alpha, &record, NULL};
static const struct app_command *const RECORD_FIRST[] = {&record, &alpha, NULL};
static const struct app_command *const *commands = COMMANDS;

/* Returns what `help WORDS` prints to the stream; free it. */
static char *printed(FILE *stream, const char *words, int want)
{
    char line[128], *argv[8] = {0}, *at = line;
    struct output output;
    int argc = 0;
    snprintf(line, sizeof line, "help %s", words);
    for (char *word; (word = strsep(&at, " ")) != NULL;)
        if (*word != '\0') argv[argc++] = word;
    output_take(&output, stream);
    const int status = help_run(commands, argc, argv);
    char *text = output_give(&output);
    if (status != want) fail_msg("help %s: status %d, %s", words, status, text);
    return text;
}

static void expect(const char *words, const char *want)
{
    char *text = printed(stdout, words, APP_OK);
    assert_string_equal(text, want);
    free(text);
}

/* ---- for people */

/* Names and arguments share a column, and all helps begin behind the longest. Lines have up to 110 columns: the
 * second word of --size ends there, and the fourth would end one column later. */
static const char ALPHA_HELP[] =
    "scanhead alpha: what `it` does\n\nusage: scanhead alpha CONFIG CLOUD -o FILE [options]\n\n"
    "  -o, --output FILE     a file's name\n"
    "      --pace PACE       .pace\n"
    "      --threads N       a key without words\n"
    "      --size N|all|7    " X42 " " X43 "\n                        " X43 "\n                        " X43 "\n"
    "      --level WORD      l\n"
    "      --folder DIR      f\n"
    "      --from DIRECTION  d\n"
    "      --set KEY=VALUE   s\n"
    "      --config CONFIG   c\n"
    "      --quiet           q\n"
    "  -h, --help [SECTION]  this text, or only that part\n"
    "\nA paragraph\nof two lines.\n\n  indented\nnot\n\n.dot \\ ^ ~\n\na  column\nmore\n";

static void the_help_of_a_command(void **state)
{
    (void)state;
    char name[] = "alpha", help[] = "--help", part[] = "head", *argv[] = {name, help, part, NULL};
    struct output output;
    expect("alpha", ALPHA_HELP);
    expect("record", "scanhead record: points\n\nusage: scanhead record\n\n  -h, --help  this text\n");
    for (int n = 2; n <= 3; n++) {
        output_take(&output, stdout);
        assert_int_equal(alpha_run(n, argv), APP_OK);
        char *text = output_give(&output);
        assert_string_equal(text, n == 2 ? ALPHA_HELP : "part head\n");
        free(text);
    }
}

/* The names of commands with their arguments, which have 38 columns, and then their summaries. */
static void the_list_of_commands(void **state)
{
    (void)state;
    char want[2048];
    snprintf(want, sizeof want,
             "scanhead: %s\n\n"
             "  scanhead alpha CONFIG CLOUD -o FILE [options]   what `it` does\n"
             "  scanhead record                                 points\n"
             "  scanhead help [COMMAND] [options]               this text, that of a command, manual pages, a "
             "completion\n"
             "\nEach command has --help. `scanhead check --help` lists all configuration keys.\n"
             "scanhead --version says which release this is.\n"
             "Exit status: 0 done, 1 failed, 2 wrong usage, configuration or input.\n",
             help_title);
    expect("", want);
    expect("--", want);
}

static void what_is_wrong_is_one_line(void **state)
{
    static const struct {
        const char *words, *line;
    } rows[] = {
        {"alhpa", "no command alhpa, did you mean alpha?"},
        {"hlep", "no command hlep, did you mean help?"},
        {"sunshine", "no command sunshine; scanhead --help lists all commands"},
        {"alpha record", "one COMMAND is allowed; record is one too many"},
        {"--man list --completion bash", "--man and --completion: allowed is one of them"},
        {"--completion zsh", "--completion zsh: allowed is bash"},
        {"--man alpha.1", "--man alpha.1: no such page; --man list prints the names of all"},
        {"--man scanhead-alpha.2", "--man scanhead-alpha.2: no such page; --man list prints the names of all"},
        {"--man scanhead-alpha.1x", "--man scanhead-alpha.1x: no such page; --man list prints the names of all"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char want[256], *text = printed(stderr, rows[i].words, APP_USAGE);
        snprintf(want, sizeof want, "scanhead help: %s; see scanhead help --help\n", rows[i].line);
        assert_string_equal(text, want);
        free(text);
    }
    assert_string_equal(help_nearest(COMMANDS, "recrod"), "record");
    assert_null(help_nearest(COMMANDS, "sunshine"));
}

/* ---- for man */

static const char ENDS[] = ".SH EXIT STATUS\n0 done, 1 failed, 2 wrong usage, configuration or input.\n.SH SEE ALSO\n";

static void expect_page(const char *words, const char *title, const char *want)
{
    char whole[8192];
    snprintf(whole, sizeof whole, ".TH %s \"\" \"scanhead %s\"\n%s", title, scanhead_version(), want);
    expect(words, whole);
}

/* Blocks of notes that are indented or have columns stay as they are. */
static void a_page_of_a_command(void **state)
{
    char want[4096];
    (void)state;
    snprintf(want, sizeof want,
             ".SH NAME\nscanhead\\-alpha \\- what \\(gait\\(ga does\n"
             ".SH SYNOPSIS\n\\fBscanhead alpha\\fR CONFIG CLOUD \\-o FILE [options]\n"
             ".SH OPTIONS\n"
             ".TP\n\\fB\\-o\\fR, \\fB\\-\\-output\\fR \\fIFILE\\fR\na file\\(aqs name\n"
             ".TP\n\\fB\\-\\-pace\\fR \\fIPACE\\fR\n\\&.pace\n"
             ".TP\n\\fB\\-\\-threads\\fR \\fIN\\fR\na key without words\n"
             ".TP\n\\fB\\-\\-size\\fR \\fIN|all|7\\fR\n" X42 " " X43 " " X43 " " X43 "\n"
             ".TP\n\\fB\\-\\-level\\fR \\fIWORD\\fR\nl\n"
             ".TP\n\\fB\\-\\-folder\\fR \\fIDIR\\fR\nf\n"
             ".TP\n\\fB\\-\\-from\\fR \\fIDIRECTION\\fR\nd\n"
             ".TP\n\\fB\\-\\-set\\fR \\fIKEY=VALUE\\fR\ns\n"
             ".TP\n\\fB\\-\\-config\\fR \\fICONFIG\\fR\nc\n"
             ".TP\n\\fB\\-\\-quiet\\fR\nq\n"
             ".TP\n\\fB\\-h\\fR, \\fB\\-\\-help\\fR \\fI[SECTION]\\fR\na text as this one, or only that part\n"
             ".SH NOTES\n.PP\nA paragraph\nof two lines.\n.PP\n.nf\n  indented\nnot\n.fi\n"
             ".PP\n\\&.dot \\e \\(ha \\(ti\n.PP\n.nf\na  column\n.fi\n"
             "%s\\fBscanhead\\fR(1),\n\\fBscanhead.yaml\\fR(5)\n",
             ENDS);
    expect_page("--man scanhead-alpha.1", "SCANHEAD\\-ALPHA 1", want);
}

/* record has a second page, that of --raw, and help has one, too. */
static void pages_of_all_commands(void **state)
{
    char want[1024];
    (void)state;
    snprintf(want, sizeof want,
             ".SH NAME\nscanhead\\-record\\-raw \\- raw data\n.SH SYNOPSIS\n\\fBscanhead record\\fR [options]\n"
             ".SH OPTIONS\n.TP\n\\fB\\-\\-raw\\fR\nr\n.TP\n\\fB\\-h\\fR, \\fB\\-\\-help\\fR\na text as this one\n"
             "%s\\fBscanhead\\fR(1),\n\\fBscanhead.yaml\\fR(5)\n",
             ENDS);
    expect_page("--man scanhead-record-raw.1", "SCANHEAD\\-RECORD\\-RAW 1", want);
    expect("--man list", "scanhead.1\nscanhead-alpha.1\nscanhead-record.1\nscanhead-help.1\nscanhead-record-raw.1\n"
                         "scanhead.yaml.5\n");
    char *text = printed(stdout, "--man scanhead-help.1", APP_OK);
    assert_non_null(strstr(text, "\n\\fBscanhead help\\fR [COMMAND] [options]\n"));
    free(text);
    app_program = "scanheadd";
    expect("--man list", "scanheadd.1\nscanheadd-alpha.1\nscanheadd-record.1\nscanheadd-help.1\n"
                         "scanheadd-record-raw.1\nscanhead.yaml.5\n");
    app_program = "scanhead";
    commands = RECORD_FIRST;
    expect("--man list", "scanhead.1\nscanhead-record.1\nscanhead-alpha.1\nscanhead-help.1\nscanhead-record-raw.1\n"
                         "scanhead.yaml.5\n");
    commands = COMMANDS;
}

static void the_page_of_the_program(void **state)
{
    char title[128], want[4096];
    (void)state;
    snprintf(title, sizeof title, ".SH NAME\nscanhead \\- %s\n", help_title);
    snprintf(
        want, sizeof want,
        "%s.SH SYNOPSIS\n.B scanhead\n\\fICOMMAND\\fR ...\n.PP\n.B scanhead \\-\\-version\n.SH COMMANDS\n"
        ".TP\n\\fBalpha\\fR CONFIG CLOUD \\-o FILE [options]\nwhat \\(gait\\(ga does;\n\\fBscanhead\\-alpha\\fR(1)\n"
        ".TP\n\\fBrecord\\fR\npoints;\n\\fBscanhead\\-record\\fR(1)\n"
        ".TP\n\\fBhelp\\fR [COMMAND] [options]\nthis text, that of a command, manual pages, a completion;\n"
        "\\fBscanhead\\-help\\fR(1)\n"
        ".SH OPTIONS\n.TP\n\\fB\\-h\\fR, \\fB\\-\\-help\\fR\nall commands, in short\n"
        ".TP\n\\fB\\-\\-version\\fR\nwhich release this is\n.SH SCANHEADD\n"
        "scanheadd is the head alone, for a board. It needs fewer libraries, and has the same help and these "
        "commands, with the same options:\nrun plan check list\n"
        ".SH ENVIRONMENT\n.TP\n.B SCANHEAD_HEADS\n"
        "the folder of head profiles, in place of the installed one\n.TP\n.B NOTIFY_SOCKET\n"
        "run reports there to the service manager when the links are open, and when its end begins (sd_notify)\n"
        "%s\\fBlibscanhead\\fR(3),\n\\fBscanhead.yaml\\fR(5)\n",
        title, ENDS);
    expect_page("--man scanhead.1", "SCANHEAD 1", want);
}

/* Appends text with the escapes of groff_char(7). */
static void put_escaped(FILE *out, const char *text)
{
    static const char *const of[] = {
        ['\\'] = "\\e", ['-'] = "\\-", ['\''] = "\\(aq", ['`'] = "\\(ga", ['^'] = "\\(ha", ['~'] = "\\(ti"};
    if (*text == '.') fputs("\\&", out);
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if (c < sizeof of / sizeof of[0] && of[c] != NULL)
            fputs(of[c], out);
        else
            fputc(c, out);
    }
}

static void next(const char **at, const char *want)
{
    const size_t n = strlen(want);
    if (strncmp(*at, want, n) != 0) fail_msg("not %.300s but %.300s", want, *at);
    *at += n;
}

/* Expects each key of a table in its order, with what it takes and its help. */
static void next_keys(const char **at, enum config_keys keys, const char *title)
{
    static struct config_key_text key;
    size_t i = 0;
    next(at, title);
    *at = strstr(*at, "\n.TP\n") + 1; /* what is said of all keys comes first */
    for (; config_describe_key(keys, i, &key); i++) {
        char *want = NULL;
        size_t len;
        FILE *out = open_memstream(&want, &len);
        assert_non_null(out);
        fputs(".TP\n\\fB", out);
        put_escaped(out, key.path);
        fputs("\\fR\n", out);
        put_escaped(out, key.what);
        fputs("\n.br\n", out);
        put_escaped(out, key.help);
        fputc('\n', out);
        fclose(out);
        next(at, want);
        free(want);
    }
    assert_true(i > 20);
}

static void the_page_of_the_configuration(void **state)
{
    (void)state;
    char *text = printed(stdout, "--man scanhead.yaml.5", APP_OK), head[128];
    const char *at = text;
    /* \& has no width. */
    snprintf(head, sizeof head, ".TH SCANHEAD\\&.YAML 5 \"\" \"scanhead %s\"\n", scanhead_version());
    next(&at, head);
    next(&at, ".SH NAME\nscanhead.yaml \\- configurations and head profiles of scanhead\n.SH DESCRIPTION\n"
              "A configuration names a head profile, a scene, stations and links. \\(gascanhead check FILE\\(ga says "
              "what is wrong with one. \\(gascanhead check \\-\\-example\\(ga prints one with all keys.\n");
    next_keys(&at, CONFIG_KEYS, ".SH KEYS OF CONFIGURATIONS\n.PP\n");
    next_keys(&at, CONFIG_PROFILE_KEYS, ".SH KEYS OF HEAD PROFILES\n.PP\n");
    next(&at, ".SH SEE ALSO\n\\fBscanhead\\-check\\fR(1)\n");
    assert_string_equal(at, "");
    free(text);
}

/* ---- for a shell */

/* Prints a key's path as it is typed: the number of each element is 0. */
static void put_typed(FILE *out, const char *path)
{
    for (; *path != '\0'; path++)
        fprintf(out, strncmp(path, "[]", 2) == 0 ? "%c0" : "%c", *path);
}

static void put_table(FILE *out)
{
    static struct config_key_text key;
    fputs("_scanhead_keys='", out);
    for (size_t i = 0; config_describe_key(CONFIG_KEYS, i, &key); i++)
        if (key.has_value) put_typed(out, key.path), fputc(' ', out);
    fputs("'\n\n_scanhead_key()\n{\n    local key=$1\n"
          "    [[ $key =~ (\\[[0-9]+\\]|\\.[0-9]+) ]] && key=${key/\"${BASH_REMATCH[1]}\"/'[0]'}\n    case $key in\n",
          out);
    for (size_t i = 0; config_describe_key(CONFIG_KEYS, i, &key); i++) {
        if (key.words == NULL) continue;
        fputs("    '", out);
        put_typed(out, key.path);
        fputs("') echo", out);
        for (const char *const *word = key.words; *word != NULL; word++)
            fprintf(out, " %s", *word);
        fputs(" ;;\n", out);
    }
    fputs("    esac\n}\n\n", out);
}

/* An option's words are those of its row or of its key, or the small words and numbers that its argument lists. Else
 * its argument says whether it is a file. */
static void the_tables_of_the_completion(void **state)
{
    (void)state;
    static struct config_key_text key;
    char *text = printed(stdout, "--completion bash", APP_OK), *want = NULL;
    size_t len;
    const char *at = text;
    FILE *out = open_memstream(&want, &len);
    assert_non_null(out);
    fputs("# bash completion for scanhead, made by: scanhead help --completion bash\n"
          "_scanhead_commands='alpha record help'\n",
          out);
    put_table(out);
    fputs("_scanhead_options()\n{\n    case $1 in\n"
          "    alpha) echo -o --output --pace --threads --size --level --folder --from --set --config --quiet -h "
          "--help ;;\n"
          "    record) echo -h --help ;;\n    help) echo --man --completion -h --help ;;\n    esac\n}\n\n"
          "_scanhead_value()\n{\n    case \"$1 $2\" in\n"
          "    'alpha --output' | 'alpha -o') echo files ;;\n    'alpha --pace') echo words realtime fast step ;;\n"
          "    'alpha --threads') echo text ;;\n    'alpha --size') echo words all 7 ;;\n"
          "    'alpha --level') echo words low high ;;\n    'alpha --folder') echo folders ;;\n"
          "    'alpha --from') echo text ;;\n    'alpha --set') echo keys ;;\n    'alpha --config') echo files ;;\n",
          out);
    fputs("    'alpha --help') echo words profile", out);
    for (size_t i = 0; config_describe_key(CONFIG_KEYS, i, &key); i++)
        if (strpbrk(key.path, ".[") == NULL) fprintf(out, " %s", key.path); /* sections */
    fputs(" ;;\n", out);
    fputs("    'help --man') echo text ;;\n    'help --completion') echo words bash ;;\n    esac\n}\n\n"
          "_scanhead_reply()\n{\n",
          out);
    fclose(out);
    next(&at, want);
    const char end[] = "\ncomplete -F _scanhead scanhead\n";
    assert_string_equal(text + strlen(text) - strlen(end), end);
    free(want);
    free(text);
}

/* Both programs may have a completion in one shell, so no function has the same name in both. */
static void each_program_has_functions_of_its_own(void **state)
{
    int n = 0;
    (void)state;
    app_program = "scanheadd";
    char *text = printed(stdout, "--completion bash", APP_OK);
    app_program = "scanhead";
    for (const char *at = text; (at = strstr(at, "_scanhead")) != NULL; at++, n++)
        if (at[9] != 'd') fail_msg("not of scanheadd: %.40s", at);
    assert_true(n >= 5);
    assert_non_null(strstr(text, "\ncomplete -F _scanheadd scanheadd\n"));
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_help_of_a_command),
        cmocka_unit_test(the_list_of_commands),
        cmocka_unit_test(what_is_wrong_is_one_line),
        cmocka_unit_test(a_page_of_a_command),
        cmocka_unit_test(pages_of_all_commands),
        cmocka_unit_test(the_page_of_the_program),
        cmocka_unit_test(the_page_of_the_configuration),
        cmocka_unit_test(the_tables_of_the_completion),
        cmocka_unit_test(each_program_has_functions_of_its_own),
    };
    return cmocka_run_group_tests_name("help", tests, NULL, NULL);
}
