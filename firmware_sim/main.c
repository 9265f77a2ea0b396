/* scanhead: the command line. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/app.h"

const struct app_command app_table[] = {
    {"run", "CONFIG [options]", "serve the head on its links until stopped", app_run},
    {"record", "SOURCE -o FILE [options]", "write the points of a scan to files", app_record},
    {"plan", "CONFIG [options]", "which method each stage will use, its error bound and its cost", app_plan},
    {"map", "CONFIG -o FILE.png [options]", "scan map of the stations, from above", app_map},
    {"report", "CONFIG CLOUD [options]", "distance of a recording's points from the scene", app_report},
    {"check", "CONFIG [options]", "validate configuration, scene and links; nothing runs", app_check},
    {"list", "", "head profiles, kinds of links, heads on USB", app_list},
    {NULL, NULL, NULL, NULL},
};

static void print_help(FILE *out)
{
    fprintf(out, "scanhead: a terrestrial laser scanner head in software, real on the wire\n\n");
    for (const struct app_command *c = app_table; c->name != NULL; c++)
        fprintf(out, "  scanhead %-7s%-30s %s\n", c->name, c->arguments, c->summary);
    fprintf(out, "\nEach command has --help. `scanhead check --help` lists all configuration keys.\n"
                 "Exit status: 0 done, 1 failed, 2 wrong usage, configuration or input.\n");
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        print_help(stderr);
        return APP_USAGE;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 || strcmp(argv[1], "help") == 0) {
        print_help(stdout);
        return APP_OK;
    }
    for (const struct app_command *c = app_table; c->name != NULL; c++)
        if (strcmp(argv[1], c->name) == 0) return c->run(argc - 1, argv + 1);
    fprintf(stderr, "scanhead: unknown command %s; see scanhead --help\n", argv[1]);
    return APP_USAGE;
}
