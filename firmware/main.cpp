// Main of the build without the Arduino core, which brings its own; therefore outside the sketch folder.
void setup();
void loop();

int main() {
    setup();
    for (;;) loop();
}
