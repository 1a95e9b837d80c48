-- G-code and STEP-NC programs by their names, whatever the case of the ending.
-- .stp and .step are also drawings of products: ours only when the header says so.
require("gcc-robot.filetype").register()
